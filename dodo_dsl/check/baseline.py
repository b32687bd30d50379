"""The baseline of a test: what its checks were in an earlier ``results.json``, than which they must not be worse."""

import functools
import json
import math
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dodo_dsl.diagnostics import Diagnostic, Fix, Span, did_you_mean, only_fix
from dodo_dsl.opendlv import regular_file
from dodo_dsl.source import Mapping, Node, Scalar, Sequence
from dodo_dsl.spec import quantity
from dodo_dsl.spec.load import of_test
from dodo_dsl.spec.manifest import Parameter
from dodo_dsl.spec.model import BASELINE, RecordedValue, Spec
from dodo_dsl.spec.values import ValueProblem, convert

TOLERANCE = 0.05
_MOST_BYTES = 50 << 20
_RESULTS = Parameter("baseline", "path", "An earlier results.json of the test.")
_HINT = "copy the results.json of a report of 'dodo run' into the registry"

Check = dict[str, Any]


@dataclass(frozen=True)
class ResolvedBaseline:
    """The values to compare with, and problems, of which the schema reports others."""

    values: tuple[RecordedValue, ...] = ()
    problems: tuple[Diagnostic, ...] = ()
    path: Path | None = None


class _WrongBaseline(Exception):
    """The problem, at its position in the spec."""

    def __init__(self, span: Span, rule: str, message: str, hint: str = "", fix: Fix | None = None) -> None:
        super().__init__(message)
        self.diagnostic = Diagnostic(span, rule, message, hint, fix=fix)


def resolved_baseline(spec: Spec) -> ResolvedBaseline:
    """The baseline of an instance; empty if it has none."""
    written = spec.baseline.value if spec.baseline else None
    place = written.get("results") if isinstance(written, Mapping) else written
    if not isinstance(place, Scalar) or not isinstance(place.value, str):
        return ResolvedBaseline()
    try:
        path = convert(_RESULTS, place, spec.location.root).path
        tolerance = _tolerance(written.get("tolerance") if isinstance(written, Mapping) else None)
        recorded = _recorded(spec, place, path or Path())
        names = written.get("checks") if isinstance(written, Mapping) else None
        return ResolvedBaseline(tuple(_values(recorded, place, names, tolerance)), path=path)
    except (ValueProblem, _WrongBaseline) as wrong:
        return ResolvedBaseline(problems=(wrong.diagnostic,))


def _tolerance(node: Node | None) -> float:
    if not isinstance(node, Scalar):
        return TOLERANCE
    try:
        share = float(quantity.convert(node.text, quantity.SHARE))
    except quantity.QuantityError:
        return TOLERANCE  # reported by the schema
    if share < 0:
        raise _WrongBaseline(node.span, "out-of-range", f"'tolerance' is {node.text}, expected at least 0 %")
    return share


def _recorded(spec: Spec, place: Scalar, path: Path) -> list[Check]:
    """The checks of this instance in the file."""
    found = results(path, path.stat().st_mtime_ns if path.is_file() else 0)
    if isinstance(found, str):
        raise _WrongBaseline(place.span, "wrong-file", f"'{place.text}': {found}", _HINT)
    slug = next((slug for slug in (spec.slug, of_test(spec).slug) if slug in found), None)
    if slug is None:
        names = ", ".join(list(found)[:3]) + (" and others" if len(found) > 3 else "")
        message = f"'{place.text}' has no results of '{spec.title}', but of {names or 'no test'}"
        raise _WrongBaseline(place.span, "wrong-file", message, _HINT)
    return found[slug]


def _values(recorded: list[Check], place: Scalar, names: Node | None, tolerance: float) -> list[RecordedValue]:
    """Those that have a value and a limit, of the names that are asked for."""
    counts: Counter[str] = Counter()
    values = []
    for check in recorded:
        name, number = check["name"], counts[check["name"]]
        counts[name] += 1
        if check["limit"] and check["value"] is not None and not name.startswith(BASELINE):
            values.append(RecordedValue(name, float(check["value"]), tolerance, number))
    if not values:
        message = f"'{place.text}' has no check of this test with a value and a limit, so there is nothing to compare"
        raise _WrongBaseline(place.span, "wrong-file", message, _HINT)
    asked = [each for each in names.items if isinstance(each, Scalar)] if isinstance(names, Sequence) else []
    known = list(dict.fromkeys(value.check for value in values))
    for each in asked:
        if each.text not in known:
            message = f"the baseline has no check '{each.text}' with a value and a limit"
            raise _WrongBaseline(
                each.span, "unknown-check", message, did_you_mean(each.text, known), only_fix(each.text, known)
            )
    return [value for value in values if not asked or value.check in {each.text for each in asked}]


@functools.lru_cache(maxsize=64)
def results(path: Path, _changed_ns: int) -> dict[str, list[Check]] | str:
    """The checks of each test of a ``results.json`` by its slug, or what is wrong with it."""
    try:
        document = json.loads(regular_file.text(path, _MOST_BYTES))
        if document["dodo"] != "results" or document["version"] != 1:
            return "not a results.json of DoDo"
        tests = {str(test["slug"]): list(test["checks"]) for test in document["tests"]}
        wrong = next((slug for slug, checks in tests.items() if not all(map(_is_check, checks))), None)
        return tests if wrong is None else f"not a results.json of DoDo: a check of '{wrong[:60]}' is malformed"
    except OSError as error:
        return f"cannot be read: {error.strerror}"
    except (ValueError, KeyError, TypeError, AttributeError, OverflowError, RecursionError):
        return "not a results.json of DoDo"


def _is_check(check: Any) -> bool:
    name = check["name"]
    return (
        isinstance(name, str) and name.isprintable() and isinstance(check["limit"], dict) and _is_number(check["value"])
    )


def _is_number(value: Any) -> bool:
    return value is None or (isinstance(value, int | float) and math.isfinite(value))
