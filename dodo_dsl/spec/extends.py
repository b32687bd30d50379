"""``extends``: a spec built on another one. Mappings merge deeply, scalars and lists replace, null removes."""

from pathlib import Path

from dodo_dsl.diagnostics import Diagnostic, Span, did_you_mean, shown_path
from dodo_dsl.source import Entry, Mapping, Node, Reader, Scalar, path_of, read
from dodo_dsl.spec.registry import near_path

KEY = "extends"
MAX_CHAIN = 8
SHIPPED = "dodo:"

_OWN = (KEY, "name")
_USES = "uses"


def resolve(node: Node, file: Path, root: Path, reader: Reader = read) -> tuple[Node, list[Diagnostic]]:
    """The spec merged over everything that it extends; spans keep the file that each value was written in.

    It stays as it is, with its key ``extends``, where one of the files that it is built on cannot be read.

    ``root`` is the registry's folder, which holds all files of the chain.
    """
    return _resolve(node, (file,), root.resolve(), reader)


def is_open(node: Node) -> bool:
    """Whether a spec that ``resolve`` returned is not merged over what it extends."""
    return isinstance(node, Mapping) and KEY in node.entries


def nothing_in(file: Path) -> Diagnostic:
    """About a test's file without content, in the same words for itself and for those that extend it."""
    return Diagnostic(Span(str(file)), "missing-key", "the file is empty, expected a test")


def _resolve(node: Node, chain: tuple[Path, ...], root: Path, reader: Reader) -> tuple[Node, list[Diagnostic]]:
    written = node.get(KEY) if isinstance(node, Mapping) else None
    if not isinstance(node, Mapping) or not isinstance(written, Scalar) or not isinstance(written.value, str):
        return node, []  # reported by the schema
    path = path_of(chain[-1].parent, written.text)
    if path is None:
        return node, [Diagnostic(written.span, "extends-file", f"'{written.text[:60]}' is not a path")]
    problem = _problem(written, path, chain, root)
    if problem:
        return node, [problem]
    base, found = reader(path)
    if not isinstance(base, Mapping):
        if base is None and not found:
            found = [nothing_in(path)]
        elif not found:
            found = [Diagnostic(written.span, "extends-file", f"'{written.text}' does not contain a test")]
        return node, found
    below, deeper = _resolve(base, (*chain, path), root, reader)
    problems = [*found, *deeper]
    assert isinstance(below, Mapping), "a mapping resolves to one"
    if KEY in below.entries:
        return node, problems
    inherited = Mapping(base.span, {key: entry for key, entry in below.entries.items() if key not in _OWN})
    own = Mapping(node.span, {key: entry for key, entry in node.entries.items() if key != KEY}, node.tag)
    return _merge(inherited, own, problems), problems


def _problem(written: Scalar, path: Path, chain: tuple[Path, ...], root: Path) -> Diagnostic | None:
    if not path.is_relative_to(root):
        message = f"'{written.text}' leaves the registry"
        return Diagnostic(written.span, "path-escape", message, "a test can only extend tests of its own registry")
    if path in chain:
        names = " extends ".join(p.name for p in (*chain[chain.index(path) :], path))
        return Diagnostic(written.span, "extends-cycle", f"the test extends itself: {names}")
    if len(chain) > MAX_CHAIN:
        return Diagnostic(written.span, "extends-cycle", f"the chain of extended tests is longer than {MAX_CHAIN}")
    if path.is_dir():
        specs = sorted(p.name for p in path.glob("*.dodo.yml"))[:6]
        hint = f"write '{written.text}/{specs[0]}'" if len(specs) == 1 else ""
        return Diagnostic(written.span, "extends-file", f"'{written.text}' is a folder, expected a test's file", hint)
    if not path.is_file():
        message = f"there is no file '{written.text}' to extend"
        fits = lambda found: found.is_file() and found not in chain  # noqa: E731
        hint, fix = near_path(written.text, chain[-1].parent, root, fits)
        if written.text.startswith(SHIPPED):
            hint, fix = "'dodo new NAME --extends TEST' copies a test that ships with DoDo", None
        return Diagnostic(written.span, "extends-file", message, hint, fix=fix)
    return None


def _merge(base: Mapping, child: Mapping, problems: list[Diagnostic], depth: int = 0) -> Mapping:
    entries = dict(base.entries)
    for key, entry in child.entries.items():
        under = entries.get(key)
        if isinstance(entry.value, Scalar) and entry.value.value is None:
            if entries.pop(key, None) is None:
                problems.append(_nothing(key, entry.key, base))
        elif under and isinstance(entry.value, Mapping) and isinstance(under.value, Mapping):
            entries[key] = Entry(entry.key, _merged(under.value, entry.value, problems, depth))
        else:
            entries[key] = entry
    return Mapping(child.span, entries, child.tag)


def _merged(base: Mapping, child: Mapping, problems: list[Diagnostic], depth: int) -> Mapping:
    """A service with another ``uses`` replaces the base's: the base's parameters do not apply to it."""
    before, after = base.get(_USES), child.get(_USES)
    if depth == 1 and after is not None and _text(before) != _text(after):
        return child
    return _merge(base, child, problems, depth + 1)


def _text(node: Node | None) -> str | None:
    return node.text if isinstance(node, Scalar) else None


def _nothing(key: str, span: Span, base: Mapping) -> Diagnostic:
    message = f"'{key}' is empty, which would remove it, but {shown_path(base.span.file)} has no such key"
    return Diagnostic(span, "extends-nothing", message, did_you_mean(key, base.entries))
