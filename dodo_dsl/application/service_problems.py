"""Problems of a service in a compose file: its name, commands, references, and what cannot be isolated.

``application-isolation``: access to the host that tests would share. ``application-hardware``: hardware, which is left
out of tests without a rig.
"""

import functools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from dodo_dsl import source
from dodo_dsl.application import host_access, opendlv_flags
from dodo_dsl.application.model import KEYS, SANDBOX, ApplicationSource, ComposeService, plain
from dodo_dsl.diagnostics import Diagnostic, Span, did_you_mean
from dodo_dsl.source import Node, Scalar

_SOCKET_HINT = "give the service a profile, so that it starts with 'docker compose --profile' and not in a test"
_WITHOUT = "is left out of sil and dil tests, which have no hardware"


@dataclass(frozen=True)
class Written:
    """A service in its application; ``others`` are all services that start, ``dropped`` has why others do not."""

    name: str
    node: source.Mapping
    key: Span
    others: frozenset[str]
    dropped: Mapping[str, str]
    containers: dict[str, str]
    volumes: Mapping[str, Any]

    @classmethod
    def of(cls, service: ComposeService, application: ApplicationSource, volumes: Mapping[str, Any]) -> "Written":
        """The service among the others of its application; ``volumes`` are the application's named ones."""
        others, containers = frozenset(application.services), dict(application.containers)
        return cls(service.name, service.node, service.span, others, application.dropped, containers, volumes)

    @functools.cached_property
    def plain(self) -> dict[str, Any]:
        value: dict[str, Any] = plain(self.node)
        return value

    def place(self, key: str, item: int | None = None) -> Span:
        """The place of a key's value, or of an item of its list."""
        entry = self.node.entries[key]
        if item is None:
            return entry.value.span if isinstance(entry.value, Scalar) and entry.value.text else entry.key
        node: Node | None = entry.value.items[item] if isinstance(entry.value, source.Sequence) else None
        inner = node.get("source") if isinstance(node, source.Mapping) else None
        return (inner or node or entry.value).span


def problems(written: Written) -> Iterator[Diagnostic]:
    """Everything wrong with one service."""
    for rule in (_name, _words, _references, _namespaces, _mounts, _external, _hardware, _single):
        yield from rule(written)


def unknown_keys(service: Node) -> Iterator[Diagnostic]:
    """Unknown keys that begin like DoDo's."""
    for word, entry in service.entries.items() if isinstance(service, source.Mapping) else ():
        if word.startswith("x-dodo") and word not in KEYS:
            hint = did_you_mean(word, KEYS)
            yield Diagnostic(entry.key, "unknown-key", f"unknown key '{word}'", hint)
        elif word not in KEYS and word.startswith("x-do") and did_you_mean(word, KEYS).startswith("did"):
            message = f"neither compose nor DoDo uses the key '{word}'"
            yield Diagnostic(entry.key, "unknown-key", message, did_you_mean(word, KEYS), "warning")


def _name(written: Written) -> Iterator[Diagnostic]:
    name = written.name
    if name == SANDBOX or name.startswith("dodo-"):
        yield _bad(written.key, f"the name '{name}' is reserved for DoDo's own services")
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
            yield _bad(written.place(key), message, hint)


def _namespaces(written: Written) -> Iterator[Diagnostic]:
    service = written.plain
    for key in host_access.NAMESPACES:
        kind, name = host_access.reference(service.get(key))
        if kind == "container" and name not in written.containers:
            yield _shared(
                written.place(key), f"'{key}' joins the container '{name}', which is not part of the application"
            )
    if service.get("pid") == "host":
        yield _shared(written.place("pid"), "'pid: host' gives access to the processes of all tests", "remove it")
    if host_access.is_true(service.get("use_api_socket", False)):
        yield _shared(
            written.place("use_api_socket"), "'use_api_socket' gives access to the Docker engine", _SOCKET_HINT
        )


def _mounts(written: Written) -> Iterator[Diagnostic]:
    for item, volume in enumerate(written.plain.get("volumes") or ()):
        found = host_access.mount(volume)
        place = written.place("volumes", item)
        about = written.volumes.get(found.source)
        if host_access.is_machine(found):
            message = f"'{found.source}' belongs to the host, so tests would share it"
            yield _shared(place, message, _SOCKET_HINT)
        elif isinstance(about, dict) and host_access.is_true(about.get("external", False)) and not found.read_only:
            hint = "mount it read-only (:ro), or remove 'external', so that compose creates it"
            yield _shared(place, f"volume '{found.source}' is external, so tests would share it", hint)


def _external(written: Written) -> Iterator[Diagnostic]:
    for item, link in enumerate(written.plain.get("external_links") or ()):
        message = f"'{link}' is a container outside the application"
        yield _shared(written.place("external_links", item), message, "make it a service of the application")
    for item, entry in enumerate(written.plain.get("volumes_from") or ()):
        kind, name, _ = host_access.borrowed(entry)
        if kind == "container" and name not in written.containers:
            place = written.place("volumes_from", item)
            yield _shared(
                place, f"the container '{name}' is not part of the application", "make it a service of the application"
            )


def _hardware(written: Written) -> Iterator[Diagnostic]:
    service = written.plain
    if host_access.is_true(service.get("privileged", False)):
        yield _absent(written.place("privileged"), f"'privileged' of '{written.name}' {_WITHOUT}")
    for key in host_access.HARDWARE_KEYS:
        for item, word in enumerate(service.get(key) or ()):
            shown = word.get("source") if isinstance(word, dict) else word
            yield _absent(written.place(key, item), f"device '{shown}' of '{written.name}' {_WITHOUT}")
    for item, volume in enumerate(service.get("volumes") or ()):
        found = host_access.mount(volume)
        if host_access.is_hardware(found):
            yield _absent(written.place("volumes", item), f"'{found.source}' of '{written.name}' {_WITHOUT}")
    for item, word in enumerate(service.get("cap_add") or ()):
        if host_access.capability(word) in host_access.MACHINE_CAPABILITIES:
            yield _absent(written.place("cap_add", item), f"capability '{word}' of '{written.name}' {_WITHOUT}")


def _single(written: Written) -> Iterator[Diagnostic]:
    service = written.plain
    deploy = service.get("deploy") or {}
    for key, value in (("scale", service.get("scale")), ("deploy", deploy.get("replicas"))):
        if isinstance(value, int) and value > 1:
            message = f"'{written.name}' has {value} replicas, but starts once in a test"
            yield Diagnostic(written.place(key), "application-file", message, "", "warning")


def _bad(span: Span, message: str, hint: str = "") -> Diagnostic:
    return Diagnostic(span, "application-file", message, hint)


def _shared(span: Span, message: str, hint: str = "") -> Diagnostic:
    return Diagnostic(span, "application-isolation", message, hint)


def _absent(span: Span, message: str) -> Diagnostic:
    return Diagnostic(span, "application-hardware", message, "test it on a rig (level hil)", "warning")
