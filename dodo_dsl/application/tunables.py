"""``x-dodo: {tune: {KP: {from: 0.2, to: 3, default: 1}}}``: parameters of the application that ``dodo tune`` varies."""

from collections.abc import Iterator
from decimal import Decimal

from dodo_dsl import source
from dodo_dsl.application.model import ApplicationSource, ComposeService
from dodo_dsl.application.test_variables import owner
from dodo_dsl.diagnostics import Diagnostic
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
    for service in application.services.values():
        for name, entry in _written(service).items():
            problems = list(_problems(name, entry))
            yield from problems
            if problems:
                continue
            one = _range(name, entry)
            other, first = seen.setdefault(name, (service.name, one))
            if _numbers(first) != _numbers(one):
                message = f"'{name}' has another range at '{other}', expected the same one: a parameter has one value"
                yield Diagnostic(entry.key, _RULE, message)


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
