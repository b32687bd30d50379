"""Problems of a service in a compose file: its name, commands, references, and what cannot be isolated."""

import functools
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from dodo_dsl import source
from dodo_dsl.application import host_access, opendlv_flags
from dodo_dsl.application.access import filled
from dodo_dsl.application.access.access_diagnostics import diagnostic, place
from dodo_dsl.application.access.service_findings import Surroundings, service_findings
from dodo_dsl.application.model import KEYS, SANDBOX, ApplicationSource, ComposeService, environment, plain
from dodo_dsl.diagnostics import Diagnostic, Fix, Span, closest, did_you_mean, only_fix
from dodo_dsl.source import Node

_CONDITIONS = ("service_started", "service_healthy", "service_completed_successfully")

_DRIVE = re.compile(r"[A-Za-z]:[/\\]")

_LONGEST_HOST = 64
"""Bytes of a host's name, and of its domain's (utsname(7))."""
_LONGEST_TEXT = 131_072
"""Bytes from which on a program takes no argument and no variable (MAX_ARG_STRLEN, with its end)."""
_LONGEST = 63
"""A service's name is also one in the test's network (RFC 1035)."""


@dataclass(frozen=True)
class Written:
    """A service in its application; ``others`` are all services that start, ``dropped`` has why others do not.

    ``filled`` is ``node`` with the known variables filled in.
    """

    name: str
    node: source.Mapping
    key: Span
    others: frozenset[str]
    dropped: Mapping[str, str]
    containers: dict[str, str]
    filled: Node
    around: Surroundings

    @classmethod
    def of(cls, service: ComposeService, application: ApplicationSource, volumes: Mapping[str, Any]) -> "Written":
        """The service among the others of its application; ``volumes`` are the application's named ones."""
        others, containers = frozenset(application.services), dict(application.containers)
        ports, limits = application.access.ports, application.limits
        around = Surroundings(application.paths, containers, volumes, ports=ports, limits=limits)
        seen = filled.node(service.node, application.known)
        return cls(service.name, service.node, service.span, others, application.dropped, containers, seen, around)

    @functools.cached_property
    def plain(self) -> dict[str, Any]:
        value: dict[str, Any] = plain(self.node)
        return value

    def place(self, key: str) -> Span:
        """The place of a key's value."""
        return place(self.node, (key,), self.key)


def problems(written: Written) -> Iterator[Diagnostic]:
    """Everything wrong with one service."""
    for rule in (_name, _words, _references, _conditions, _volumes, _access, _single, _engine):
        yield from rule(written)


def unknown_keys(service: Node) -> Iterator[Diagnostic]:
    """Unknown keys that begin like DoDo's."""
    entries = service.entries if isinstance(service, source.Mapping) else {}
    for word, entry in entries.items():
        if word.startswith("x-dodo") and word not in KEYS:
            hint, fix = did_you_mean(word, KEYS), only_fix(word, KEYS, entries)
            yield Diagnostic(entry.key, "unknown-key", f"unknown key '{word}'", hint, fix=fix)
        elif word not in KEYS and word.startswith("x-do") and did_you_mean(word, KEYS).startswith("did"):
            message = f"neither compose nor DoDo uses the key '{word}'"
            yield Diagnostic(entry.key, "unknown-key", message, did_you_mean(word, KEYS), "warning")


def _name(written: Written) -> Iterator[Diagnostic]:
    name = written.name
    if name == SANDBOX or name.startswith("dodo-"):
        yield _bad(written.key, f"the name '{name}' is reserved for DoDo's own services")
    if len(name) > _LONGEST:
        yield _bad(written.key, f"the name of a service has {len(name)} characters, expected at most {_LONGEST}")
    if not any(written.plain.get(key) for key in ("image", "build", "x-dodo-process")):
        yield _bad(written.key, f"'{name}' has neither 'image' nor 'build', so it cannot be started")


def _words(written: Written) -> Iterator[Diagnostic]:
    for key in ("entrypoint", "command"):
        value = written.plain.get(key)
        if isinstance(value, str):
            try:
                opendlv_flags.split(value)
            except ValueError as error:
                yield _bad(written.place(key), f"'{key}' of '{written.name}': {error}")


def _references(written: Written) -> Iterator[Diagnostic]:
    for key, name in host_access.references(written.plain, written.containers):
        if name in written.others or (name in written.dropped and key != "volumes_from"):
            continue
        if name in written.dropped:
            message = f"'{name}', whose volumes '{written.name}' uses, does not start: {written.dropped[name]}"
            yield _bad(written.place(key), message)
        else:
            hint = did_you_mean(name, written.others)
            message = f"'{key}' of '{written.name}' names the unknown service '{name}'"
            fix = only_fix(name, written.others, _taken(written, key))
            yield _bad(_of_name(written, key, name), message, hint, fix)


def _conditions(written: Written) -> Iterator[Diagnostic]:
    """What compose does not know of ``depends_on``."""
    needed = written.plain.get("depends_on")
    for name, about in needed.items() if isinstance(needed, dict) else ():
        condition = about.get("condition") if isinstance(about, dict) else None
        if isinstance(condition, str) and condition not in _CONDITIONS and "$" not in condition:
            message = f"'{condition}' is not a condition of 'depends_on'"
            near = closest(condition, _CONDITIONS)
            hint = f"did you mean '{near[0]}'?" if near else f"known: {', '.join(_CONDITIONS)}"
            yield _bad(place(written.node, ("depends_on", name, "condition"), written.key), message, hint)


def _taken(written: Written, key: str) -> list[str]:
    """The services that a key cannot name, too: those that it names already, and the service itself."""
    named = host_access.references(written.plain, written.containers)
    return [written.name, *(name for other, name in named if other == key)]


def _of_name(written: Written, key: str, name: str) -> Span:
    """The place of a service's name in the value of a key."""
    node = written.node.get(key)
    if isinstance(node, source.Mapping) and name in node.entries:
        return node.entries[name].key
    items = node.items if isinstance(node, source.Sequence) else ()
    fits = (item.span for item in items if isinstance(item, source.Scalar) and name in item.text.split(":"))
    return next(fits, written.place(key))


def _volumes(written: Written) -> Iterator[Diagnostic]:
    """Named volumes that are not declared, which compose refuses; a test may set the variables of others."""
    known = written.around.volumes
    for item, volume in enumerate(written.plain.get("volumes") or ()):
        if isinstance(volume, str) and _DRIVE.match(volume):
            message = f"compose takes '{volume[:2]}' of '{volume}' for a drive of Windows, and mounts no volume"
            yield _bad(place(written.node, ("volumes", item), written.key), message, "give the volume a longer name")
        name = host_access.named_volume(volume)
        if name and name not in known:
            steps = ("volumes", item, "source") if isinstance(volume, dict) else ("volumes", item)
            hint = did_you_mean(name, known)
            hint = hint if hint.startswith("did") else f"declare it at the end of the file: 'volumes: {{{name}: }}'"
            message = f"'{written.name}' mounts the volume '{name}', which the top-level 'volumes' do not declare"
            near = only_fix(name, known)
            fix = Fix(f"{name}:/", f"{near.new}:/") if near and isinstance(volume, str) else near
            yield _bad(place(written.node, steps, written.key), message, hint, fix)


def _access(written: Written) -> Iterator[Diagnostic]:
    for finding in service_findings(written.name, plain(written.filled), written.around):
        yield diagnostic(finding, written.node, written.key)


def _single(written: Written) -> Iterator[Diagnostic]:
    service = written.plain
    deploy = service.get("deploy") or {}
    for key, value in (("scale", service.get("scale")), ("deploy", deploy.get("replicas"))):
        if isinstance(value, int) and value > 1:
            message = f"'{written.name}' has {value} replicas, but starts once in a test"
            yield Diagnostic(written.place(key), "application-file", message, "", "warning")


def _engine(written: Written) -> Iterator[Diagnostic]:
    """What the kernel or the engine refuses, and compose does not see: long names and texts, images in capitals."""
    seen = plain(written.filled)
    for key in ("hostname", "domainname"):
        value = seen.get(key)
        if isinstance(value, str) and "$" not in value and len(value.encode()) > _LONGEST_HOST:
            message = f"'{key}' of '{written.name}' has {len(value.encode())} bytes, and Linux takes {_LONGEST_HOST}"
            yield _bad(written.place(key), message, "shorten it")
    image = str(seen.get("image") or "")
    if "$" not in image and (name := _repository(image)) != name.lower():
        hint = f"write {image.replace(name, name.lower(), 1)}"
        yield _bad(written.place("image"), f"the image '{image}' has capitals, which no engine takes in its name", hint)
    texts = [(key, f"{key}={value}") for key, value in environment(seen.get("environment")).items()]
    words = seen.get("command")
    texts += [("command", str(word)) for word in words] if isinstance(words, list) else []
    for name, text in texts:
        if len(text.encode()) >= _LONGEST_TEXT:
            message = (
                f"'{name}' of '{written.name}' has {len(text.encode()):,} bytes, expected fewer than {_LONGEST_TEXT:,}"
            )
            key = "command" if name == "command" else "environment"
            yield _bad(written.place(key), message, "put it into a file that the service mounts")


def _repository(image: str) -> str:
    """The part of an image's name that is in small letters: without registry, tag and digest."""
    host, sign, rest = image.partition("@")[0].partition("/")
    has_host = bool(sign) and ("." in host or ":" in host or host == "localhost")
    name = rest if has_host else f"{host}{sign}{rest}"
    return name.partition(":")[0]


def _bad(span: Span, message: str, hint: str = "", fix: Fix | None = None) -> Diagnostic:
    return Diagnostic(span, "application-file", message, hint, fix=fix)
