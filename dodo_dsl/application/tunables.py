"""``x-dodo: {tune: {KP: {from: 0.2, to: 3, default: 1}}}``: parameters of the application that ``dodo tune`` varies."""

from collections.abc import Iterator
from decimal import Decimal

from dodo_dsl import source
from dodo_dsl.application.compose_files import variables_of
from dodo_dsl.application.interpolation import names
from dodo_dsl.application.model import ApplicationSource, ComposeService, environment, plain
from dodo_dsl.application.test_variables import owner
from dodo_dsl.diagnostics import Diagnostic, closest
from dodo_dsl.source import Entry, Scalar
from dodo_dsl.spec.instances.vary import Range

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
        for file in service.env_files:
            found.update(variables_of(application.folder / file.path) if application.paths.is_own(file.path) else ())
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
