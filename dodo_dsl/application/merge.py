"""Compose files merged as ``docker compose -f a.yml -f b.yml`` does (compose specification, chapter 13).

Keys that may be written in several forms are brought into one: to be merged, and once more for all that reads them.
"""

import os
from collections import abc
from collections.abc import Callable
from dataclasses import replace

from dodo_dsl.application.interpolation import filled, split_outside
from dodo_dsl.source import Entry, Mapping, Node, Plain, Scalar, Sequence, plain

Place = tuple[str, ...]
_REMOTE = ("/", "~", "$", "git@", "github.com/", "service:", "target:")
NAMESPACES = ("network_mode", "ipc", "pid")
_OUTSIDE = ("",)


def merged(base: Node, over: Node) -> Node:
    """Two files as one; ``over`` takes precedence, and its lists are appended."""
    return _merge(base, over, ())


def merged_service(base: Node, over: Node) -> Node:
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


def normal(document: Mapping) -> Mapping:
    """A file with one form of each key of its services; what has none of the forms stays, to be reported."""
    services = document.get("services")
    if not isinstance(services, Mapping):
        return document
    entries = {name: Entry(entry.key, _formed(entry.value, ())) for name, entry in services.entries.items()}
    made = Entry(document.entries["services"].key, replace(services, entries=entries))
    return replace(document, entries={**document.entries, "services": made})


def _formed(node: Node, place: Place) -> Node:
    if place in _FORMS and not (isinstance(node, Scalar) and node.value is None):
        node = replace(_FORMS[place](node), tag=node.tag)
    if place not in ((), ("build",)) or not isinstance(node, Mapping):
        return node
    return replace(node, entries={k: Entry(e.key, _formed(e.value, (*place, k))) for k, e in node.entries.items()})


def joined(service: Mapping, containers: dict[str, str]) -> Mapping:
    """A service that names other services where it names their containers, by ``containers``."""

    def named(node: Node) -> Node:
        if isinstance(node, Sequence):
            return replace(node, items=tuple(map(named, node.items)))
        kind, *rest = node.text.split(":", 2) if isinstance(node, Scalar) else ("",)
        if kind != "container" or rest[0] not in containers:
            return node
        text = ":".join(["service", containers[rest[0]], *rest[1:]])
        return Scalar(node.span, text, text)

    keys = service.entries.keys() & {*NAMESPACES, "volumes_from"} if containers else ()
    own = {key: Entry(service.entries[key].key, named(service.entries[key].value)) for key in keys}
    return replace(service, entries=service.entries | own)


def _merge(base: Node, over: Node, path: Place) -> Node:
    place = path[2:] if path[:1] == ("services",) else _OUTSIDE
    if over.tag == "!override" or place in _REPLACED:
        return over
    if isinstance(over, Scalar) and over.value is None:
        return base
    if isinstance(base, Mapping) and isinstance(over, Mapping):
        return _merge_mappings(base, over, path)
    if isinstance(base, Sequence) and isinstance(over, Sequence):
        return replace(base, items=_appended(base, over, place))
    return over


def _merge_mappings(base: Mapping, over: Mapping, path: Place) -> Mapping:
    entries = dict(base.entries)
    for key, entry in over.entries.items():
        if entry.value.tag == "!reset":
            entries.pop(key, None)
        elif key in entries:
            entries[key] = Entry(entry.key, _merge(entries[key].value, entry.value, (*path, key)))
        else:
            entries[key] = entry
    return replace(base, entries=entries)


def _appended(base: Sequence, over: Sequence, place: Place) -> tuple[Node, ...]:
    items = (*base.items, *over.items)
    key = _target if place in _BY_TARGET else lambda item: repr(plain(item))
    return tuple({key(item): item for item in items}.values())


def _target(item: Node) -> str:
    value = plain(item)
    if isinstance(value, dict):
        return str(value.get("target", value.get("source")))
    parts = str(value).split(":")
    return parts[1] if len(parts) > 1 else parts[0]


def _as_pairs(node: Node) -> Node:
    """``[A=1, B]`` as ``{A: 1, B: null}``."""
    if not isinstance(node, Sequence) or (items := _texts(node)) is None:
        return node
    parts = ((item.span, *item.text.partition("=")) for item in items)
    entries = {name: Entry(span, Scalar(span, value if sign else None, value)) for span, name, sign, value in parts}
    return Mapping(node.span, entries)


def _texts(node: Sequence) -> list[Scalar] | None:
    found = [item for item in node.items if isinstance(item, Scalar) and isinstance(item.value, str)]
    return found if len(found) == len(node.items) else None


def _as_list(node: Node) -> Node:
    return Sequence(node.span, (node,)) if isinstance(node, Scalar) else node


def _as_hosts(node: Node) -> Node:
    """``{name: address}`` as ``[name:address]``, as a name may have several."""
    if not isinstance(node, Mapping):
        return node
    texts = [(e.key, f"{k}:{e.value.text if isinstance(e.value, Scalar) else ''}") for k, e in node.entries.items()]
    return Sequence(node.span, tuple(Scalar(span, text, text) for span, text in texts))


def _as_keys(node: Node) -> Node:
    """``[a]`` as ``{a: }``."""
    return _each(node, lambda item: Scalar(item.span, None, ""))


def _as_waits(node: Node) -> Node:
    """``[a]`` as ``{a: {condition: service_started}}``."""
    return _each(node, lambda item: _as_fields(item, condition="service_started"))


def _each(node: Node, made: Callable[[Scalar], Node]) -> Node:
    if not isinstance(node, Sequence) or (items := _texts(node)) is None:
        return node
    return Mapping(node.span, {item.text: Entry(item.span, made(item)) for item in items})


def _as_fields(node: Node, **fields: Plain | Mapping) -> Mapping:
    """A short form as fields, each in the place of the whole."""
    values = {k: v if isinstance(v, Mapping) else Scalar(node.span, v, str(v)) for k, v in fields.items()}
    return Mapping(node.span, {key: Entry(node.span, value) for key, value in values.items()})


def _as_build(node: Node) -> Node:
    return Mapping(node.span, {"context": Entry(node.span, node)}) if isinstance(node, Scalar) else node


def _as_files(node: Node) -> Node:
    """``a.env`` as ``[{path: a.env}]``."""
    items = node.items if isinstance(node, Sequence) else (node,)
    return Sequence(node.span, tuple(_as_fields(i, path=i.value) if isinstance(i, Scalar) else i for i in items))


def _as_mounts(node: Node) -> Node:
    """``[./a:/b:ro]`` as ``[{type: bind, source: ./a, target: /b, read_only: true}]``."""
    return replace(node, items=tuple(map(_as_mount, node.items))) if isinstance(node, Sequence) else node


def _as_mount(item: Node) -> Node:
    if isinstance(item, Mapping):
        kind, word = item.get("type"), item.get("source")
        if not isinstance(word, Scalar) or kind is None or plain(kind) != "bind" or is_path(word.text or "."):
            return item
        path = replace(word, value=f"./{word.text}", text=f"./{word.text}")
        return replace(item, entries=item.entries | {"source": Entry(item.entries["source"].key, path)})
    if not isinstance(item, Scalar) or not isinstance(item.value, str):
        return item
    source, target, options, *_ = [*split_outside(item.text, ":"), "", ""]
    if ":" not in item.text:
        return _as_fields(item, type="volume", target=item.text)
    words = options.split(",")
    is_read = [word for word in words if word in ("ro", "rw")][-1:] == ["ro"]
    about = {"volume": _as_fields(item, nocopy=True)} if "nocopy" in words else {}
    return _as_fields(
        item, type="bind" if is_path(source) else "volume", source=source, target=target, read_only=is_read, **about
    )


_REPLACED = {("command",), ("entrypoint",), ("healthcheck", "test")}
_BY_TARGET = {("volumes",), ("devices",), ("secrets",), ("configs",)}
_LISTS = (
    "cap_add", "dns", "dns_opt", "dns_search", "expose", "group_add", "links", "security_opt", "tmpfs", "volumes_from",
)  # fmt: skip
_FORMS: dict[Place, Callable[[Node], Node]] = {
    ("environment",): _as_pairs,
    **{("build", key): _as_pairs for key in ("args", "additional_contexts")},
    **{(key,): _as_list for key in _LISTS},
    ("build",): _as_build,
    ("depends_on",): _as_waits,
    ("env_file",): _as_files,
    ("extra_hosts",): _as_hosts,
    ("networks",): _as_keys,
    ("volumes",): _as_mounts,
}


def changed(node: Node, change: Callable[[Scalar, Place], str], place: Place = ()) -> Node:
    """A node with each text changed, by the keys that lead to it; every part keeps its place."""
    if isinstance(node, Mapping):
        entries = {k: Entry(e.key, changed(e.value, change, (*place, k))) for k, e in node.entries.items()}
        return replace(node, entries=entries)
    if isinstance(node, Sequence):
        return replace(node, items=tuple(changed(item, change, place) for item in node.items))
    if not isinstance(node.value, str):
        return node
    text = change(node, place)
    return node if text == node.value else replace(node, value=text, text=text)


def filled_node(node: Node, known: abc.Mapping[str, str], late: Callable[[str], bool]) -> Node:
    return changed(node, lambda word, *_: filled(str(word.value), known, late))


def relocated(document: Mapping, base: str) -> Node:
    """A file in normal form with its paths as seen from the folder from which ``base`` leads to its own."""

    def moved(word: Scalar, place: Place) -> str:
        text, key = str(word.value), (place[0], *place[2:]) if place else ()
        is_mount = key == ("services", "volumes", "source") and is_path(text)
        return rebased(text, base) if key in _PATHS or key[:3] == _CONTEXTS or is_mount else text

    return changed(document, moved)


_PATHS = {("services", "build", "context"), ("services", "env_file", "path"), ("secrets", "file"), ("configs", "file")}
_CONTEXTS = ("services", "build", "additional_contexts")


def rebased(path: str, base: str) -> str:
    """A path as seen from another folder, from which ``base`` is the path's own; absolute paths and URLs stay."""
    if (path.startswith(_REMOTE) and not path.startswith("$$")) or "://" in path:
        return path
    joined = os.path.normpath(f"{base}/{path}")
    return joined if joined.startswith((".", "/")) else f"./{joined}"


def is_path(text: str) -> bool:
    """Whether a volume's source is a path; other words name a volume."""
    return text.startswith((".", "/", "~"))


def is_local(context: str) -> bool:
    """Whether what is built is a folder, and not known to be elsewhere."""
    return "://" not in context and not context.startswith(_REMOTE)
