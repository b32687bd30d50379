"""Compose files merged as ``docker compose -f a.yml -f b.yml`` does (compose specification, chapter 13)."""

from collections.abc import Callable
from dataclasses import replace

from dodo_dsl.application.interpolation import split_outside
from dodo_dsl.source import Entry, Mapping, Node, Scalar, Sequence, plain

Path = tuple[str, ...]

_OUTSIDE = ("",)


def merged(base: Node, over: Node) -> Node:
    """Two files as one; ``over`` takes precedence, and its lists are appended."""
    return _merge(base, over, ())


def merged_service(base: Node, over: Node) -> Node:
    """Two definitions of one service as one."""
    return _merge(base, over, ("services", ""))


def settled(node: Node) -> Node:
    """A file after all merges: without the keys that ``!reset`` removes, and without ``!override``."""
    tag = "" if node.tag == "!override" else node.tag
    if isinstance(node, Mapping):
        kept = {k: e for k, e in node.entries.items() if e.value.tag != "!reset"}
        return Mapping(node.span, {k: Entry(e.key, settled(e.value)) for k, e in kept.items()}, tag)
    if isinstance(node, Sequence):
        return Sequence(node.span, tuple(settled(i) for i in node.items if i.tag != "!reset"), tag)
    return replace(node, tag=tag) if node.tag else node


def _merge(base: Node, over: Node, path: Path) -> Node:
    place = path[2:] if path[:1] == ("services",) else _OUTSIDE
    if over.tag == "!override" or place in _REPLACED:
        return over
    if isinstance(over, Scalar) and over.value is None:
        return base
    form = _FORMS.get(place)
    if form is not None:
        base, over = form(base), form(over)
    if isinstance(base, Mapping) and isinstance(over, Mapping):
        return _merge_mappings(base, over, path)
    if isinstance(base, Sequence) and isinstance(over, Sequence):
        return replace(base, items=_appended(base, over, place))
    return over


def _merge_mappings(base: Mapping, over: Mapping, path: Path) -> Mapping:
    entries = dict(base.entries)
    for key, entry in over.entries.items():
        if entry.value.tag == "!reset":
            entries.pop(key, None)
        elif key in entries:
            entries[key] = Entry(entry.key, _merge(entries[key].value, entry.value, (*path, key)))
        else:
            entries[key] = entry
    return replace(base, entries=entries)


def _appended(base: Sequence, over: Sequence, place: Path) -> tuple[Node, ...]:
    items = (*base.items, *over.items)
    if place in _BY_TARGET:
        return tuple({_target(item): item for item in items}.values())
    if place in _FORMS:
        return tuple({repr(plain(item)): item for item in items}.values())
    return items


def _target(item: Node) -> str:
    """The path of a mount, device, secret or config in the container."""
    value = plain(item)
    if isinstance(value, dict):
        return str(value.get("target", value.get("source")))
    parts = split_outside(str(value), ":")
    return parts[1] if len(parts) > 1 else parts[0]


def as_pairs(node: Node) -> Node:
    """``[A=1, B]`` as ``{A: 1, B: null}``."""
    if not isinstance(node, Sequence):
        return node
    entries = {}
    for item in node.items:
        name, sign, value = (item.text if isinstance(item, Scalar) else "").partition("=")
        entries[name] = Entry(item.span, Scalar(item.span, value if sign else None, value))
    return Mapping(node.span, entries)


def _as_list(node: Node) -> Node:
    return Sequence(node.span, (node,)) if isinstance(node, Scalar) else node


def _as_hosts(node: Node) -> Node:
    """``{name: address}`` as ``[name:address]``, as a name may have several."""
    if not isinstance(node, Mapping):
        return node
    texts = [(e.key, f"{k}:{e.value.text if isinstance(e.value, Scalar) else ''}") for k, e in node.entries.items()]
    return Sequence(node.span, tuple(Scalar(span, text, text) for span, text in texts))


def as_waits(node: Node) -> Node:
    """``[a]`` as ``{a: {condition: service_started}}``."""
    started = Scalar(node.span, "service_started", "service_started")
    return _as_keys(node, Mapping(node.span, {"condition": Entry(node.span, started)}))


def _as_keys(node: Node, value: Node | None = None) -> Node:
    """``[a]`` as ``{a: }``, or with another value."""
    if not isinstance(node, Sequence):
        return node
    empty = value or Scalar(node.span, None, "")
    return Mapping(node.span, {i.text: Entry(i.span, empty) for i in node.items if isinstance(i, Scalar)})


def _as_build(node: Node) -> Node:
    return Mapping(node.span, {"context": Entry(node.span, node)}) if isinstance(node, Scalar) else node


_REPLACED = {("command",), ("entrypoint",), ("healthcheck", "test")}
_BY_TARGET = {("volumes",), ("devices",), ("secrets",), ("configs",)}
_LISTS = (
    "cap_add", "cap_drop", "device_cgroup_rules", "dns", "dns_opt", "dns_search", "env_file", "expose",
    "group_add", "links", "profiles", "security_opt", "tmpfs", "volumes_from",
)  # fmt: skip
_FORMS: dict[Path, Callable[[Node], Node]] = {
    **{(key,): as_pairs for key in ("environment", "sysctls")},
    **{("build", key): as_pairs for key in ("args", "additional_contexts")},
    **{(key,): _as_list for key in _LISTS},
    ("build",): _as_build,
    ("depends_on",): as_waits,
    ("networks",): _as_keys,
    ("extra_hosts",): _as_hosts,
}
