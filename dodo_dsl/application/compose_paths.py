"""Relative paths in a compose file: where they occur, and how they are written from another folder."""

import os
import re
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from dodo_dsl import source
from dodo_dsl.application import interpolation
from dodo_dsl.diagnostics import Span
from dodo_dsl.source import Entry, Node, Scalar

Change = Callable[[str], str]

_HERE = re.compile(r"\$(?:PWD|\{PWD(?::?-[^{}]*)?\})(?=/|$)")
_DEFAULT = re.compile(r"(?P<head>\$\{[A-Za-z_][A-Za-z0-9_]*:?-)(?P<path>\.\.?(?:/[^{}]*)?)\}")
_WORD = re.compile(r"\$\{[A-Za-z_][A-Za-z0-9_]*:?-(?P<word>[^}].*)\}")
_REMOTE = ("/", "~", "git@", "github.com/", "service:", "target:")


def rebased(path: str, base: str) -> str:
    """A path as seen from another folder, from which ``base``, as it is ``escaped`` there, is the path's own folder.

    Absolute paths, URLs and variables stay; ``${PWD}`` is the compose file's folder, where compose is started, and a
    variable's default is a path too.
    """
    path = _HERE.sub(".", path, count=1) if path.startswith("$") else path
    if path.startswith(_REMOTE) or "://" in path:
        return path
    if path.startswith("$"):
        return _DEFAULT.sub(lambda m: f"{m['head']}{rebased(m['path'], base)}}}", path, count=1)
    joined = f"{base}/{path.removeprefix('./')}"
    joined = joined if "$" in joined else os.path.normpath(joined)
    return joined if joined.startswith((".", "/")) else f"./{joined}"


def escaped(text: str) -> str:
    """A path as a compose file has it, in which a dollar sign alone begins a variable."""
    return text.replace("$", "$$")


def escaped_values(value: Any) -> Any:
    """Values of JSON with all their texts escaped."""
    return _texts(value, escaped)


def unescaped(value: Any) -> Any:
    """What ``docker compose config`` shows, which escapes all texts, as they are."""
    return _texts(value, lambda text: text.replace("$$", "$"))


def _texts(value: Any, change: Change) -> Any:
    if isinstance(value, dict):
        return {key: _texts(each, change) for key, each in value.items()}
    if isinstance(value, list):
        return [_texts(each, change) for each in value]
    return change(value) if isinstance(value, str) else value


def _as_relative(path: str) -> str:
    """A path with a variable in a file's name, after ``./``: ``${CAR:-kiwi}.env`` is next to the compose file."""
    if not path.startswith("$") or "://" in path or _HERE.match(path):
        return path
    end = interpolation.end_of_variable(path, 0)
    default = _WORD.match(path[:end])
    is_name = path[end : end + 1] not in ("", "/") or (default is not None and default["word"][:1] not in "/~.$")
    return f"./{path}" if is_name else path


def is_path(text: str) -> bool:
    """Whether a volume's source is a path; other words name a volume."""
    return text.startswith((".", "/", "~", "$"))


def is_local(context: str) -> bool:
    """Whether what is built is a folder, and not known to be elsewhere."""
    return "$" not in context and "://" not in context and not context.startswith(_REMOTE)


def mapped_service(service: source.Mapping, change: Change) -> source.Mapping:
    """A service with ``change`` applied to each of its paths."""
    return _mapped(service, _SERVICE, change)


def mapped_rest(rest: Mapping[str, Node], change: Change) -> dict[str, Node]:
    """Top-level volumes, secrets and configs likewise."""
    return {key: _each(node, _TOP[key], change) if key in _TOP else node for key, node in rest.items()}


def _mapped(node: Node, table: Mapping[str, Callable[[Node, Change], Node]], change: Change) -> source.Mapping:
    assert isinstance(node, source.Mapping)
    entries = {k: Entry(e.key, table[k](e.value, change)) if k in table else e for k, e in node.entries.items()}
    return replace(node, entries=entries)


def _scalar(node: Node, change: Change) -> Node:
    if not isinstance(node, Scalar) or not isinstance(node.value, str):
        return node
    text = change(node.value)
    return replace(node, value=text, text=text)


def _path(node: Node, change: Change) -> Node:
    return _scalar(node, lambda text: change(_as_relative(text)))


def _each(node: Node, form: Callable[[Node, Change], Node], change: Change) -> Node:
    if isinstance(node, source.Sequence):
        return replace(node, items=tuple(form(item, change) for item in node.items))
    if isinstance(node, source.Mapping):
        return replace(node, entries={k: Entry(e.key, form(e.value, change)) for k, e in node.entries.items()})
    return node


def _build(node: Node, change: Change) -> Node:
    if not isinstance(node, source.Mapping):
        return _path(node, change)
    if "context" not in node.entries:
        here = Entry(node.span, Scalar(node.span, ".", "."))
        node = replace(node, entries={"context": here, **node.entries})
    return _mapped(node, {"context": _path, "additional_contexts": _contexts}, change)


def _contexts(node: Node, change: Change) -> Node:
    def after_sign(text: str) -> str:
        name, sign, path = text.partition("=")
        return name + sign + change(path)

    return _each(node, _scalar, change if isinstance(node, source.Mapping) else after_sign)


def _env_file(node: Node, change: Change) -> Node:
    if isinstance(node, source.Sequence):
        return _each(node, _env_file, change)
    return _mapped(node, {"path": _path}, change) if isinstance(node, source.Mapping) else _path(node, change)


def _volume(node: Node, change: Change) -> Node:
    if isinstance(node, source.Mapping):
        kind, bind = node.get("type"), isinstance(node.get("source"), Scalar)
        is_bind = bind and isinstance(kind, Scalar) and kind.value == "bind"
        return _mapped(node, {"source": _scalar}, change) if is_bind else node

    if not isinstance(node, Scalar) or not isinstance(node.value, str):
        return node
    origin, *others = interpolation.split_outside(node.value, ":")
    if not others or not is_path(origin):
        return node
    changed = change(origin)
    if len(interpolation.split_outside(changed, ":")) > 1:
        return _long_volume(node.span, changed, *others)
    return _scalar(node, lambda _: ":".join([changed, *others]))


_BIND_OPTIONS = {
    **dict.fromkeys(("z", "Z"), "selinux"),
    **dict.fromkeys(("shared", "rshared", "slave", "rslave", "private", "rprivate"), "propagation"),
}


def _long_volume(span: Span, origin: str, target: str, options: str = "") -> source.Mapping:
    """A mount whose origin has a colon, which the short form cannot say; the folder must be there."""
    words = options.split(",")
    bind: dict[str, source.Plain] = {"create_host_path": False}
    for word in words:
        if key := _BIND_OPTIONS.get(word):
            bind[key] = word
    mount: dict[str, source.Plain] = {"type": "bind", "source": origin, "target": target, "read_only": "ro" in words}
    return _mapping(span, {**_scalars(span, mount), "bind": _mapping(span, _scalars(span, bind))})


def _mapping(span: Span, nodes: Mapping[str, Node]) -> source.Mapping:
    return source.Mapping(span, {key: Entry(span, node) for key, node in nodes.items()})


def _scalars(span: Span, values: Mapping[str, source.Plain]) -> dict[str, Node]:
    return {key: Scalar(span, value, str(value)) for key, value in values.items()}


def _security(node: Node, change: Change) -> Node:
    def profile(text: str) -> str:
        match = re.match(r"seccomp[:=](?!unconfined|builtin|\{)", text)
        return match[0] + change(text[match.end() :]) if match else text

    return _scalar(node, profile)


def _file(node: Node, change: Change) -> Node:
    return _mapped(node, {"file": _path}, change) if isinstance(node, source.Mapping) else node


def _may_be_bound(kind: Node | None, device: Node | None) -> bool:
    """Whether ``o`` makes the device a path: a variable's default may, and its value if the device looks like one."""
    if not isinstance(kind, Scalar) or not isinstance(device, Scalar):
        return False
    is_word = bool({"bind", "rbind"} & set(re.split(r"[^a-z]+", kind.text)))
    return is_word or ("$" in kind.text and is_path(device.text))


def _named_volume(node: Node, change: Change) -> Node:
    options = node.get("driver_opts") if isinstance(node, source.Mapping) else None
    if not isinstance(node, source.Mapping) or not isinstance(options, source.Mapping):
        return node
    if not _may_be_bound(options.get("o"), options.get("device")):
        return node
    return _mapped(node, {"driver_opts": lambda o, c: _mapped(o, {"device": _scalar}, c)}, change)


_SERVICE: dict[str, Callable[[Node, Change], Node]] = {
    "build": _build,
    "env_file": _env_file,
    "label_file": _env_file,
    "volumes": lambda node, change: _each(node, _volume, change),
    "security_opt": lambda node, change: _each(node, _security, change),
    "credential_spec": _file,
}
_TOP: dict[str, Callable[[Node, Change], Node]] = {"secrets": _file, "configs": _file, "volumes": _named_volume}
