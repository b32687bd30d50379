"""Variables of an application: those that a test sets, and those that ``dodo tune`` varies.

A test sets ``application: {env: {SPEED: 0.5}}``. The application has parameters to tune by
``x-dodo: {tune: {KP: {from: 0.2, to: 3, default: 1}}}``.
"""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from decimal import Decimal

from dodo_dsl import source
from dodo_dsl.application.access.secret_variables import is_steering
from dodo_dsl.application.interpolation import changed_node, names, with_values
from dodo_dsl.application.model import ApplicationSource, ComposeService, environment, plain
from dodo_dsl.application.opendlv_flags import CID_VARIABLES
from dodo_dsl.diagnostics import Diagnostic, closest
from dodo_dsl.source import Entry, Node, Scalar
from dodo_dsl.spec.vary import Range

_LIBRARIES = ("CLUON_SHAREDMEMORY_POSIX", "VIRTUAL_ENV")
_SPLIT = frozenset("\"'\\;&|<>()`")
_COMMANDS = ("entrypoint", "command")


def owner(name: str) -> str:
    """Why a test may not set a variable; empty if it may."""
    if name in CID_VARIABLES:
        return "it holds the test's own CID"
    if name.upper().startswith("DODO_"):
        return "it is DoDo's own"
    if is_steering(name) or name in _LIBRARIES:
        return "it steers programs and libraries, which the sandbox decides"
    return ""


def split_by(application: ApplicationSource, name: str, value: str) -> str:
    """The service whose command, a string, a value would tear apart with a quotation mark or similar; else empty."""
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


_KEYS = ("from", "to", "default")
_RULE = "application-file"


def tunables(application: ApplicationSource) -> tuple[Range, ...]:
    """The parameters of all services, by the names of their variables, in the order in which they are written.

    The application has no ``tunable_problems``; a parameter of several services has one value.
    """
    found: dict[str, Range] = {}
    for service in application.services.values():
        for name, entry in _written(service).items():
            found.setdefault(name, _range(name, entry))
    return tuple(found.values())


def tunable_problems(application: ApplicationSource) -> Iterator[Diagnostic]:
    """Parameters that are DoDo's own, without a range, or with different ones at several services."""
    seen: dict[str, tuple[str, Range]] = {}
    used = _variables(application)
    for service in application.services.values():
        for name, entry in _written(service).items():
            problems = list(_problems(name, entry))
            near = closest(name.lower(), {each.lower() for each in used}) if name not in used else []
            if meant := [each for each in sorted(used) if each.lower() in near[:1]]:
                message = f"nothing in the application uses the variable '{name}'"
                yield Diagnostic(entry.key, _RULE, message, f"did you mean '{meant[0]}'?", "warning")
            yield from problems
            if problems:
                continue
            one = _range(name, entry)
            other, first = seen.setdefault(name, (service.name, one))
            if _numbers(first) != _numbers(one):
                message = f"'{name}' has another range at '{other}', expected the same one: a parameter has one value"
                yield Diagnostic(entry.key, _RULE, message)


def _variables(application: ApplicationSource) -> set[str]:
    """The variables that the services set or fill in; a program may read others."""
    found: set[str] = set()
    for service in application.services.values():
        found.update(environment(plain(service.node).get("environment")))
        texts = (part.text for part in source.walk(service.node) if isinstance(part, Scalar))
        found.update(*map(names, texts))
        found.update(service.file_variables)
    return found


def _written(service: ComposeService) -> dict[str, Entry]:
    declared = service.node.get("x-dodo")
    tune = declared.get("tune") if isinstance(declared, source.Mapping) else None
    return dict(tune.entries) if isinstance(tune, source.Mapping) else {}


def _scalars(entry: Entry) -> tuple[Scalar, ...]:
    node = entry.value
    found = [node.get(key) for key in _KEYS] if isinstance(node, source.Mapping) else []
    return tuple(one for one in found if isinstance(one, Scalar))


def _range(name: str, entry: Entry) -> Range:
    low, high, default = _scalars(entry)
    return Range(name, default, (low, high))


def _numbers(one: Range) -> tuple[Decimal, ...]:
    return tuple(one.number(end.text) for end in (*one.ends, one.nominal))


def _problems(name: str, entry: Entry) -> Iterator[Diagnostic]:
    """Problems of one parameter that the schema does not see."""
    if why := owner(name):
        yield Diagnostic(entry.key, _RULE, f"'{name}' cannot be tuned: {why}")
        return
    one = _range(name, entry)
    if broken := [end for end in (*one.ends, one.nominal) if not _is_decimal(one, end)]:
        yield Diagnostic(broken[0].span, _RULE, f"'{broken[0].text}' is not a finite decimal number")
        return
    low, high, default = _numbers(one)
    if low >= high:
        message = f"'from' is {one.ends[0].text}, expected less than 'to', {one.ends[1].text}"
        yield Diagnostic(one.ends[0].span, _RULE, message)
    elif not low <= default <= high:
        message = f"'default' is {one.nominal.text}, expected {one.ends[0].text} to {one.ends[1].text}"
        yield Diagnostic(one.nominal.span, _RULE, message)


def _is_decimal(one: Range, end: Scalar) -> bool:
    try:
        return one.number(end.text).is_finite()
    except (ArithmeticError, ValueError):
        return False
