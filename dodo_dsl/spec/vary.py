"""``vary``: ranges of values, which replace placeholders as ``${vary.light}``."""

from collections.abc import Iterator
from dataclasses import dataclass
from decimal import Decimal

from dodo_dsl.diagnostics import Diagnostic, did_you_mean
from dodo_dsl.source import Entry, Mapping, Node, Scalar, Sequence, entries, part
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
        return (", " if self.is_list else " to ").join(end.text for end in self.ends)

    def number(self, text: str) -> Decimal:
        return _number(text, self.unit)


def _number(text: str, unit: str) -> Decimal:
    """Raises QuantityError for what is not a number in the unit, or without one."""
    if unit:
        return quantity.convert(text, unit)
    if quantity.written_unit(text) != "":
        raise quantity.QuantityError(f"'{text[:60]}' is not a number without a unit", quantity.with_point(text[:60]))
    return Decimal(text.strip())


def nominal(ranges: tuple[Range, ...]) -> Values:
    return {one.name: one.nominal for one in ranges}


def corners(ranges: tuple[Range, ...]) -> list[Values]:
    """Choices that have every end of every range once, as many at a time as there are."""
    number = max((len(one.ends) for one in ranges), default=0)
    return [{one.name: one.ends[i] for one in ranges if i < len(one.ends)} for i in range(number)]


def read(node: Node) -> tuple[tuple[Range, ...], list[Diagnostic]]:
    """The ranges of a spec in the order in which they are written, and their problems.

    One without a nominal value is left out, one with problems has no ends; the schema reports what is not of its type.
    """
    ranges: list[Range] = []
    found: list[Diagnostic] = []
    for name, entry in entries(node, KEY).items():
        low, high, among, middle = (part(entry.value, key) for key in ("from", "to", "among", "nominal"))
        one, problems = None, list[Diagnostic]()
        if not isinstance(middle, Scalar) or (among is None and None in (low, high)) or (among and (low or high)):
            problems = [_incomplete(name, entry)]
        elif isinstance(among, Sequence):
            ends = tuple(item for item in among.items if isinstance(item, Scalar))
            one, problems = Range(name, middle, ends, is_list=True), list(_of_list(middle, ends))
        elif isinstance(low, Scalar) and isinstance(high, Scalar):
            unit = quantity.written_unit(low.text)
            one, problems = Range(name, middle, (low, high), unit or ""), list(of_numbers(middle, low, high, unit))
        if isinstance(middle, Scalar):
            ranges.append(one if one and not problems else Range(name, middle, ()))
        found += problems if isinstance(entry.value, Mapping) else ()
    return tuple(ranges), found


def _incomplete(name: str, entry: Entry) -> Diagnostic:
    hint = "write for example {from: 0.3, to: 2, nominal: 1} or {among: [plain, wood], nominal: plain}"
    message = f"range '{name}' has not 'nominal', and either 'from' and 'to' or 'among'"
    return Diagnostic(entry.key, "missing-key", message, hint)


def _of_list(middle: Scalar, ends: tuple[Scalar, ...]) -> Iterator[Diagnostic]:
    texts = [end.text for end in ends]
    for number, end in enumerate(ends):
        if end.text in texts[:number]:
            yield Diagnostic(end.span, "vary-range", f"'{end.text}' stands twice in 'among'")
    if middle.text not in texts:
        message = f"'nominal' is '{middle.text}', expected one of {', '.join(texts)}"
        yield Diagnostic(middle.span, "vary-range", message, did_you_mean(middle.text, texts))


def of_numbers(
    middle: Scalar, low: Scalar, high: Scalar, unit: str | None, key: str = "nominal"
) -> Iterator[Diagnostic]:
    """What is wrong with a range of numbers in a unit, empty for bare ones, None for none; ``key`` is the middle's."""
    if unit is None:
        message = f"'from' is '{low.text[:60]}', expected a number or a quantity"
        hint = quantity.with_point(low.text) or "for other values write 'among: [plain, wood]'"
        yield Diagnostic(low.span, "vary-range", message, hint)
        return
    numbers = []
    for name, scalar in (("from", low), (key, middle), ("to", high)):
        try:
            numbers.append(_number(scalar.text, unit))
        except quantity.QuantityError as error:
            yield Diagnostic(scalar.span, "wrong-unit", f"'{name}': {error}", error.hint)
    if len(numbers) == 3 and numbers[0] >= numbers[2]:
        yield Diagnostic(low.span, "vary-range", f"'from' is {low.text}, expected less than 'to', {high.text}")
    elif len(numbers) == 3 and not numbers[0] <= numbers[1] <= numbers[2]:
        yield Diagnostic(middle.span, "vary-range", f"'{key}' is {middle.text}, expected {low.text} to {high.text}")
