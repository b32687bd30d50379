"""The end of a run: its summary, and its report on disk."""

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TextIO

from dodo_dsl import package_data
from dodo_dsl.cli import display
from dodo_dsl.cli.display import Verbosity
from dodo_dsl.cli.progress import count
from dodo_dsl.diagnostics import Piece, shown_path
from dodo_dsl.outcome import NotRun, Outcome
from dodo_dsl.plan.model import Plan
from dodo_dsl.report import checks, results
from dodo_dsl.report.files import PAGE
from dodo_dsl.report.instances import summary
from dodo_dsl.report.next_report import NextReport
from dodo_dsl.report.overview import Past
from dodo_dsl.report.report_folder import write_summaries
from dodo_dsl.report.results import Circumstances, GivenReport
from dodo_dsl.spec.load import load_spec
from dodo_dsl.spec.registry import locate
from dodo_dsl.terminal import printable

_MOST_NAMES = 5
_REPEATED = re.compile(r"(\[(run=\d+|sample=\d+,[^\]]*)\])+$")
_INDENT = len("PASSED  ")


@dataclass(frozen=True)
class Reported:
    """What the summary says of a test beyond its outcome: its Plan, its folder in the report, and that as shown."""

    plan: Plan
    folder: Path
    shown: Path

    def page(self) -> Path:
        """The page to open: the test's own, or else the report's."""
        return self.shown / PAGE if (self.folder / PAGE).is_file() else self.shown.parent / "index.html"


def write_summary(
    stream: TextIO,
    outcomes: Sequence[Outcome],
    not_run: Sequence[NotRun],
    verbosity: Verbosity = Verbosity.NORMAL,
    reported: Mapping[str, Reported] | None = None,
) -> None:
    """A table of the tests that passed, then each of the others with what explains it, then the counts."""
    is_quiet = verbosity is Verbosity.QUIET
    blank = "" if is_quiet else "\n"
    stream.write(blank)
    about = reported or {}
    passed = [] if is_quiet else [outcome for outcome in outcomes if outcome.outcome == "passed"]
    others = sorted((o for o in outcomes if o.outcome != "passed"), key=lambda o: o.outcome == "error")
    for group, head in ((passed, _row), (others, _reason)):
        names = max((len(outcome.name) for outcome in group), default=0)
        if group and group is passed:
            heading = f"{'':{_INDENT}}{'test':<{names}}  {'time':>7}  {'real':>7}  closest to failing\n"
            display.write_coloured(stream, [(heading, "gutter")])
        for outcome in group:
            word = (f"{outcome.outcome.upper():<6}", display.OF_OUTCOMES[outcome.outcome])
            line = f"  {printable(outcome.name):<{names}}  {printable(head(outcome))}".rstrip()
            display.write_coloured(stream, [word, (f"{line}\n", "")])
            _write_details(stream, outcome, verbosity, about.get(outcome.slug))
    stream.write(blank)
    if not is_quiet:
        stream.writelines(f"{printable(line)}\n" for line in summary(outcomes))
    display.write_coloured(stream, _counts(outcomes))
    if not_run:
        some = ", ".join(test.name for test in not_run[:_MOST_NAMES])
        more = f" and {len(not_run) - _MOST_NAMES} more" if len(not_run) > _MOST_NAMES else ""
        display.write_coloured(stream, [(f"{count(len(not_run))} not run", "not run")])
        stream.write(f", because {not_run[0].reason}: {printable(some)}{more}\n")


def _row(outcome: Outcome) -> str:
    """Of a test that passed: its own time, the real time of set-up and drive, and its decisive check."""
    real = None if outcome.execution_s is None else (outcome.setup_s or 0.0) + outcome.execution_s
    own = outcome.execution_s if outcome.sim_s is None else outcome.sim_s
    figures = "  ".join(("" if seconds is None else f"{seconds:.1f} s").rjust(7) for seconds in (own, real))
    check = checks.decisive(outcome)
    return f"{figures}  {checks.in_words(check) if check else outcome.reason}"


def _reason(outcome: Outcome) -> str:
    """The verdict's sentence, and how long the test took."""
    if outcome.setup_s is None or outcome.execution_s is None:
        return outcome.reason
    return f"{outcome.reason} (set-up {outcome.setup_s:.1f} s, ran {outcome.execution_s:.1f} s)"


def _write_details(stream: TextIO, outcome: Outcome, verbosity: Verbosity, about: Reported | None) -> None:
    """What explains an outcome, below its line."""

    def say(text: str) -> None:
        stream.write(f"{'':{_INDENT}}{printable(text)}\n")

    is_verbose = verbosity is Verbosity.VERBOSE
    if is_verbose and outcome.outcome == "passed":
        say(_reason(outcome))
    failed = [c for c in outcome.checks if not c["ok"] and not checks.only_follows(c, outcome.checks)]
    for check in outcome.checks if is_verbose else failed:
        say(checks.check_line(check, outcome.checks))
    if outcome.outcome != "passed" and about:
        for place in _places(outcome, about.plan, failed):
            say(f"in {place}")
    for note in outcome.notes:
        say(f"note: {note}")
    if is_verbose:
        for use in outcome.resources:
            say(f"{use.service}: {use.in_words()}")
    if outcome.outcome != "passed":
        for line in outcome.last_lines:
            say(f"| {line}")
        if about:
            say(f"open {about.page()}")


def _places(outcome: Outcome, plan: Plan, failed: Sequence[Mapping[str, Any]]) -> list[str]:
    """Where the spec sets the limits that were not met; else where it has the service that the sentence names."""
    from dodo_dsl.report.viewer.page import limit_places

    found = [place for check in failed for _, place in limit_places(plan, check["name"], {})]
    judges = [v["evaluator"] for v in outcome.verdicts if v.get("outcome") == "failed"]
    found = found or [place for name in judges if (place := plan.source_map.get(f"evaluation.{name}"))]
    found = found or list(filter(None, (plan.place_named_in(outcome.reason) or plan.source_map.get("name"),)))
    places = dict.fromkeys(f"{_shown_file(place.file)}:{place.line}:{place.column}" for place in found)
    return list(places) or [_shown_file(plan.spec)]


def _shown_file(name: str) -> str:
    """The path of a spec's file from the working folder, which may lie below that of the deployment."""
    roots = (Path.cwd(), *Path.cwd().parents, package_data.registry())
    return next((shown_path(str(root / name)) for root in roots if (root / name).is_file()), name)


def _counts(outcomes: Sequence[Outcome]) -> Iterator[Piece]:
    """How many tests passed, failed and ended in error; what there is, in colour."""
    for between, kind, word in (("", "passed", "passed"), (", ", "failed", "failed"), (", ", "error", "in error")):
        number = sum(outcome.outcome == kind for outcome in outcomes)
        yield between, ""
        yield f"{number} {word}", display.OF_OUTCOMES[kind] if number else ""
    yield "\n", ""


def earlier(report: Path, names: Collection[str], registry: Sequence[Path]) -> GivenReport | None:
    """What a report has of other tests than those of these names, however often they ran; None if there is none.

    Tests and instances that ``registry`` has no longer are left out; without one, none is.
    """
    try:
        found = results.read_given(report)
    except results.ResultsError:
        return None
    tests = {outcome.slug: _REPEATED.sub("", outcome.name) for outcome in found.outcomes}
    ran = {_REPEATED.sub("", name) for name in names}
    there = {location.stem: location for location in locate([], registry)[0]}
    stems = {name.partition("[")[0] for name in tests.values()} & there.keys()
    titles = {spec.title for stem in stems for spec in load_spec(there[stem])[0]}

    def is_there(outcome: Outcome) -> bool:
        name = tests[outcome.slug]
        if name.partition("[")[0] in stems:
            return name in titles
        return not registry or Path(outcome.spec).is_file()

    kept = [outcome for outcome in found.outcomes if tests[outcome.slug] not in ran and is_there(outcome)]
    return GivenReport(found.file, kept, Circumstances(found.circumstances.runs)) if kept else None


def save_report(
    target: NextReport,
    shown: Path,
    outcomes: Sequence[Outcome],
    others: GivenReport | None,
    circumstances: Circumstances,
    past: Past,
) -> tuple[str, bool]:
    """Puts the report of these jobs in its place, which is ``shown`` to users; ``others`` are of an earlier run.

    Returns a sentence on where it is, and whether it is whole. Where no test began, the report before stays.
    """
    if not outcomes and circumstances.not_run and (target.place / results.FILE_NAME).is_file():
        return f"report: no test of this run began, so {shown / 'index.html'} is still that of the run before", True
    reports = [GivenReport(target.place / results.FILE_NAME, outcomes, circumstances), *([others] if others else [])]
    every = [outcome for one in reports for outcome in one.outcomes]
    kept = {outcome.slug for outcome in (others.outcomes if others else ())}
    try:
        target.take_place([outcome.slug for outcome in outcomes], kept)
        write_summaries(target.place, every, results.joined(reports), past=past)
    except Exception as error:  # noqa: BLE001  (the outcomes are printed)
        why = getattr(error, "strerror", None) or f"{type(error).__name__}: {error}"
        return f"'{shown}' cannot take the whole report: {why}", False
    beside = f", with {count(len(kept), 'test')} of earlier runs" if kept else ""
    return f"report: {shown / 'index.html'}{beside}", True
