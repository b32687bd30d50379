"""Variables that a test sets for its application: ``application: {env: {SPEED: 0.5}}``."""

from collections.abc import Mapping
from dataclasses import replace

from dodo_dsl import source
from dodo_dsl.application.access.secret_variables import is_steering
from dodo_dsl.application.interpolation import changed_node, names, with_values
from dodo_dsl.application.model import ApplicationSource, ComposeService
from dodo_dsl.application.opendlv_flags import CID_VARIABLES
from dodo_dsl.source import Entry, Node, Scalar

_LIBRARIES = ("CLUON_SHAREDMEMORY_POSIX", "VIRTUAL_ENV")
_SPLIT = frozenset("\"'\\;&|<>()`")
_COMMANDS = ("entrypoint", "command")


def owner(name: str) -> str:
    """Why a test may not set a variable; empty where it may."""
    if name in CID_VARIABLES:
        return "it holds the test's own CID"
    if name.upper().startswith("DODO_"):
        return "it is DoDo's own"
    if is_steering(name) or name in _LIBRARIES:
        return "it steers programs and libraries, which the sandbox decides"
    return ""


def split_by(application: ApplicationSource, name: str, value: str) -> str:
    """The service whose command, a string, a value would tear apart with a quotation mark or the like; else empty."""
    for service in application.services.values():
        commands = (service.node.get(key) for key in _COMMANDS)
        if _SPLIT & set(value) and any(isinstance(c, Scalar) and name in names(c.text) for c in commands):
            return service.name
    return ""


def with_variables(application: ApplicationSource, values: Mapping[str, str]) -> ApplicationSource:
    """The application with variables set in each service's environment, and filled in there and in its commands."""
    if not values:
        return application
    services = {name: _service(service, values) for name, service in application.services.items()}
    return replace(application, services=services)


def _service(service: ComposeService, values: Mapping[str, str]) -> ComposeService:
    entries = dict(service.node.entries)
    for key in _COMMANDS:
        if key in entries:
            entries[key] = Entry(entries[key].key, _filled(entries[key].value, values))
    written = entries.get("environment")
    place = written.key if written else service.span
    entries["environment"] = Entry(place, _environment(written.value if written else None, values, service))
    return replace(service, node=replace(service.node, entries=entries))


def _environment(written: Node | None, values: Mapping[str, str], service: ComposeService) -> Node:
    """The service's environment, in its own form, with the values in place of its own ones."""
    literal = {name: value.replace("$", "$$") for name, value in values.items()}
    if isinstance(written, source.Sequence):
        kept = [_filled(i, values) for i in written.items if not (isinstance(i, Scalar) and _name(i) in values)]
        return replace(written, items=(*kept, *(_scalar(service, f"{n}={value}") for n, value in literal.items())))
    old = written.entries if isinstance(written, source.Mapping) else {}
    entries = {name: Entry(entry.key, _filled(entry.value, values)) for name, entry in old.items()}
    new = {name: Entry(service.span, _scalar(service, value)) for name, value in literal.items()}
    return source.Mapping(service.span, {**entries, **new})


def _name(item: Scalar) -> str:
    return item.text.partition("=")[0]


def _scalar(service: ComposeService, text: str) -> Scalar:
    return Scalar(service.span, text, text)


def _filled(node: Node, values: Mapping[str, str]) -> Node:
    return changed_node(node, lambda text: with_values(text, values))
