"""``vary``: ranges of values, which replace placeholders as ``${vary.light}``.

A plain run takes the nominal values; ``dodo search`` looks for conditions within the ranges.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from decimal import Decimal

from dodo_dsl.diagnostics import Diagnostic, did_you_mean
from dodo_dsl.source import Entry, Mapping, Node, Scalar, Sequence
from dodo_dsl.spec import quantity
from dodo_dsl.spec.matrix import Placeholders

KEY = "vary"
PLACEHOLDERS = Placeholders(KEY, "add it with its range under 'vary'", points_at_value=True)
Values = dict[str, Scalar]
"""One value of each range, by its name."""


@dataclass(frozen=True)
class Range:
    """From ``ends[0]`` to ``ends[-1]`` in ``unit``, empty for bare numbers; or one of ``ends`` where ``is_list``."""

    name: str
    nominal: Scalar
    ends: tuple[Scalar, ...]
    unit: str = ""
    is_list: bool = False

    @property
    def text(self) -> str:
        """``0.3 to 2``, or ``plain, wood``"""
        return (", " if self.is_list else " to ").join(end.text for end in self.ends)

    def number(self, text: str) -> Decimal:
        """A value of a range of numbers, in its unit."""
        return _number(text, self.unit)


def _number(text: str, unit: str) -> Decimal:
    """Raises QuantityError for what is not a number in the unit, or without one."""
    if unit:
        return quantity.convert(text, unit)
    if quantity.written_unit(text) != "":
        raise quantity.QuantityError(f"'{text[:60]}' is not a number without a unit", quantity.with_point(text[:60]))
    return Decimal(text.strip())


def nominal(ranges: tuple[Range, ...]) -> Values:
    """What a plain run takes."""
    return {one.name: one.nominal for one in ranges}


def corners(ranges: tuple[Range, ...]) -> list[Values]:
    """Choices that have every end of every range once, as many at a time as there are."""
    number = max((len(one.ends) for one in ranges), default=0)
    return [{one.name: one.ends[i] for one in ranges if i < len(one.ends)} for i in range(number)]


def read(node: Node) -> tuple[tuple[Range, ...], list[Diagnostic]]:
    """The ranges of a spec in the order in which they are written, and their problems.

    One without a nominal value is left out, one with problems has no ends; the schema reports what is not of its type.
    """
    written = node.get(KEY) if isinstance(node, Mapping) else None
    ranges: list[Range] = []
    found: list[Diagnostic] = []
    for name, entry in written.entries.items() if isinstance(written, Mapping) else ():
        if not isinstance(entry.value, Mapping):
            continue
        missing = list(_missing(name, entry, entry.value))
        found.extend(missing)
        middle = entry.value.get("nominal")
        if isinstance(middle, Scalar):
            one, problems = (Range(name, middle, ()), []) if missing else _range(name, entry, entry.value, middle)
            ranges.append(replace(one, ends=()) if problems else one)
            found.extend(problems)
    return tuple(ranges), found


def _missing(name: str, entry: Entry, node: Mapping) -> Iterator[Diagnostic]:
    """The keys that a range needs; a test that extends another one may have them from there."""
    needed = ("nominal",) if "among" in node.entries else ("from", "to", "nominal")
    if missing := [f"'{key}'" for key in needed if key not in node.entries]:
        hint = "write for example {from: 0.3, to: 2, nominal: 1} or {among: [plain, wood], nominal: plain}"
        yield Diagnostic(entry.key, "missing-key", f"range '{name}' has no {' and no '.join(missing)}", hint)


def _range(name: str, entry: Entry, node: Mapping, middle: Scalar) -> tuple[Range, list[Diagnostic]]:
    low, high, among = (node.get(key) for key in ("from", "to", "among"))
    none = Range(name, middle, ())
    if among is not None and (low is not None or high is not None):
        message = f"range '{name}' has 'among' beside 'from' or 'to', expected one of them"
        return none, [Diagnostic(entry.key, "vary-range", message)]
    if isinstance(among, Sequence):
        ends = tuple(item for item in among.items if isinstance(item, Scalar))
        return Range(name, middle, ends, is_list=True), list(_of_list(middle, ends))
    if not isinstance(low, Scalar) or not isinstance(high, Scalar):
        return none, []
    unit = quantity.written_unit(low.text)
    if unit is None:
        message = f"'from' is '{low.text[:60]}', expected a number or a quantity"
        hint = quantity.with_point(low.text) or "for other values write 'among: [plain, wood]'"
        return none, [Diagnostic(low.span, "vary-range", message, hint)]
    return Range(name, middle, (low, high), unit), list(_of_numbers(middle, low, high, unit))


def _of_list(middle: Scalar, ends: tuple[Scalar, ...]) -> Iterator[Diagnostic]:
    texts = [end.text for end in ends]
    for number, end in enumerate(ends):
        if end.text in texts[:number]:
            yield Diagnostic(end.span, "vary-range", f"'{end.text}' stands twice in 'among'")
    if middle.text not in texts:
        message = f"'nominal' is '{middle.text}', expected one of {', '.join(texts)}"
        yield Diagnostic(middle.span, "vary-range", message, did_you_mean(middle.text, texts))


def _of_numbers(middle: Scalar, low: Scalar, high: Scalar, unit: str) -> Iterator[Diagnostic]:
    numbers = {}
    for key, scalar in (("from", low), ("to", high), ("nominal", middle)):
        try:
            numbers[key] = _number(scalar.text, unit)
        except quantity.QuantityError as error:
            yield Diagnostic(scalar.span, "wrong-unit", f"'{key}': {error}", error.hint)
    if len(numbers) < 3:
        return
    if numbers["from"] >= numbers["to"]:
        yield Diagnostic(low.span, "vary-range", f"'from' is {low.text}, expected less than 'to', {high.text}")
    elif not numbers["from"] <= numbers["nominal"] <= numbers["to"]:
        yield Diagnostic(middle.span, "vary-range", f"'nominal' is {middle.text}, expected {low.text} to {high.text}")
