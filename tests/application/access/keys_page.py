"""docs/reference/compose-keys.md, made from the tables."""

from dodo_dsl.application.access import compose_keys

_HEAD = """\
# Keys of compose files

What becomes of each key of the [compose specification](https://github.com/compose-spec/compose-spec) in a test's copy
of an application's compose file: *kept* as it is, *rewritten*, *removed*, or *refused*, which is an error. A key that
has no row here is unknown and refused, except your own, which begin with `x-`.
[sandbox.md](sandbox.md#what-it-may-use-of-the-host) says which values may be used.

`make goldens` generates this page from `dodo_dsl/application/access/compose_keys.py`.
"""


def text() -> str:
    """The page."""
    parts = [_HEAD]
    for title, rows in compose_keys.TABLES.items():
        parts.append(f"\n## {title[0].upper()}{title[1:]}\n\n| key | | why |\n|---|---|---|\n")
        parts.extend(f"| `{key}` | {row.treatment} | {row.why} |\n" for key, row in sorted(rows.items()))
    return "".join(parts)
