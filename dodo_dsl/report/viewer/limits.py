"""Each check's limit with the lines of the spec that set it."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from dodo_dsl import package_data
from dodo_dsl.opendlv import regular_file
from dodo_dsl.outcome import (
    MEMORY_GROWTH,
    PEAK_MEMORY,
    PROCESSOR_SHARE,
    PROCESSOR_TIME,
    SAMPLE_TIMES,
    SLOW_ANSWERS,
    Outcome,
)
from dodo_dsl.plan.model import Place, Plan, PlannedService
from dodo_dsl.report import check_words
from dodo_dsl.report.viewer.encoded import shown

_OF_THE_TEST = {SLOW_ANSWERS: "max", SAMPLE_TIMES: "sample-times"}
"""Checks of no evaluator, and the key of the test's ``response`` that asks for them."""
_OF_USE = {
    PEAK_MEMORY: "max-memory",
    MEMORY_GROWTH: "max-memory-growth",
    PROCESSOR_TIME: "max-processor-time",
    PROCESSOR_SHARE: "max-processor-share",
}
"""The same of the test's ``resources``; the name of a service follows that of the check."""
_MOST_SPEC = 1 << 20

Parameters = Mapping[str, Mapping[str, tuple[str, ...]]]
"""What sets the limits of checks: names of parameters by the evaluator's name and the check's, as they recorded it."""


class SpecLines:
    """Lines of specs by their places, as far as the files can be read from here."""

    def __init__(self, roots: tuple[Path, ...] = ()) -> None:
        self._roots = roots or (Path.cwd(), package_data.root(), package_data.registry())
        self._files: dict[str, list[str]] = {}

    def line(self, place: Place) -> str:
        """The line without its indent; empty where there is no such file any more."""
        if place.file not in self._files:
            self._files[place.file] = self._read(place.file)
        lines = self._files[place.file]
        return shown(lines[place.line - 1].strip(), 400) if 0 < place.line <= len(lines) else ""

    def _read(self, name: str) -> list[str]:
        for root in self._roots:
            path = root / name
            try:
                if path.resolve().is_relative_to(root.resolve()):
                    return regular_file.text(path, _MOST_SPEC).splitlines()
            except (OSError, ValueError):
                continue
        return []


def checks(plan: Plan, outcome: Outcome, lines: SpecLines, recorded: Parameters) -> Iterator[dict[str, Any]]:
    """All checks, each with the places of its limit: the parameter's, or the service's where it is set by default."""
    for check in outcome.checks:
        places = list(_places(plan, check["name"], recorded)) if check.get("limit") else []
        yield {
            "name": shown(check["name"], 100),
            "value": check["value"],
            "limits": [shown(words, 80) for words in check_words.limits(check)],
            "unit": shown(check.get("unit") or "", 40),
            "ok": bool(check["ok"]),
            "follows": check_words.only_follows(check, outcome.checks),
            "margin": check.get("margin"),
            "places": [
                {"file": shown(place.file, 400), "line": place.line, "text": lines.line(place), "flag": flag}
                for flag, place in places
            ],
        }


def _places(plan: Plan, check: str, recorded: Parameters) -> Iterator[tuple[str, Place]]:
    if check in _OF_THE_TEST and "response" in plan.source_map:
        yield _OF_THE_TEST[check], plan.source_map["response"]
    for name, flag in _OF_USE.items():
        if check.startswith(f"{name}-") and "resources" in plan.source_map:
            yield flag, plan.source_map["resources"]
    for service in plan.services:
        if not service.judge:
            continue
        key, names = f"{service.layer}.{service.name}", _parameters(service, check, recorded)
        found = [(name, plan.source_map[f"{key}.{name}"]) for name in names if f"{key}.{name}" in plan.source_map]
        if found:
            yield from found
        elif names and key in plan.source_map:
            yield "", plan.source_map[key]


def _parameters(service: PlannedService, check: str, recorded: Parameters) -> list[str]:
    """The parameters of a judge that set the limit of a check: those that it recorded, else by their names."""
    named = recorded.get(service.name, {}).get(check, (f"max-{check}", f"min-{check}", check))
    own = {flag.name for flag in service.flags}
    return [name for name in named if name in own]
