"""The end of a run: its summary, its report on disk, and the history of its tests."""

import itertools
import re
import textwrap
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
from dodo_dsl.report import checks, overview, results
from dodo_dsl.report.files import LOGS, PAGE
from dodo_dsl.report.instances import compared
from dodo_dsl.report.next_report import NextReport
from dodo_dsl.report.report_folder import Drawable, write_summaries
from dodo_dsl.report.results import Circumstances, GivenReport
from dodo_dsl.run.backends import Job
from dodo_dsl.run.history import History
from dodo_dsl.terminal import cells, clipped, printable, width_of

_MOST_NAMES = 5
_REPEATED = re.compile(r"(\[(run=\d+|sample=\d+,[^\]]*)\])+$")
_MOST_COMPLAINTS = 20
"""Of one service of a test."""
_INDENT = len("PASSED  ")
_NARROWEST_NAME = 20
_BESIDE_NAME = 44
"""Columns of a row without its name: the outcome, two times, and a margin without its limit."""


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
    tests: Mapping[str, str],
    not_run: Sequence[NotRun],
    verbosity: Verbosity = Verbosity.NORMAL,
    reported: Mapping[str, Reported] | None = None,
) -> None:
    """A table of the tests that passed, then each of the others with what explains it, then the counts.

    ``tests`` has each slug's name without repetition. Lines fit into a terminal; a file or pipe gets them whole.
    """
    is_quiet = verbosity is Verbosity.QUIET
    blank = "" if is_quiet else "\n"
    stream.write(blank)
    width, about = width_of(stream), reported or {}
    passed = [] if is_quiet else [outcome for outcome in outcomes if outcome.outcome == "passed"]
    rows = _table(passed, width)
    display.write_coloured(stream, next(rows, ()))
    for outcome, row in zip(passed, rows, strict=True):
        display.write_coloured(stream, row)
        if verbosity is Verbosity.VERBOSE:
            display.write_coloured(stream, _wrapped(f"{outcome.reason}{_times(outcome)}", width))
        _write_details(stream, outcome, verbosity, about.get(outcome.slug), width)
    others = sorted((o for o in outcomes if o.outcome != "passed"), key=lambda o: o.outcome == "error")
    names = max((len(outcome.name) for outcome in others), default=0)
    for outcome in others:
        head = f"{printable(outcome.name):<{names}}  {outcome.reason}{_times(outcome)}"
        display.write_coloured(stream, _wrapped(head, width, outcome))
        _write_details(stream, outcome, verbosity, about.get(outcome.slug), width)
    stream.write(blank)
    if not is_quiet:
        stream.writelines(f"{printable(one.in_words())}\n" for one in compared(outcomes))
    if len(set(tests.values())) < len(tests):
        stream.writelines(f"{line}\n" for line in _rates(outcomes, tests))
    display.write_coloured(stream, _counts(outcomes))
    if not_run:
        some = ", ".join(test.name for test in not_run[:_MOST_NAMES])
        more = f" and {len(not_run) - _MOST_NAMES} more" if len(not_run) > _MOST_NAMES else ""
        display.write_coloured(stream, [(f"{count(len(not_run))} not run", "not run")])
        stream.write(f", because {not_run[0].reason}: {printable(some)}{more}\n")


def _table(passed: Sequence[Outcome], width: int | None) -> Iterator[list[Piece]]:
    """A heading, then a row for each test: its own time, the real time of set-up and drive, and its decisive check."""
    if not passed:
        return
    most = None if width is None else max(_NARROWEST_NAME, width - _BESIDE_NAME)
    names = max((len(o.name) for o in passed if most is None or len(o.name) <= most), default=_NARROWEST_NAME)
    heading = f"{'':{_INDENT}}{'test':<{names}}  {'time':>7}  {'real':>7}  closest to failing"
    yield [(clipped(heading, width) + "\n", "gutter")]
    for outcome in passed:
        real = None if outcome.execution_s is None else (outcome.setup_s or 0.0) + outcome.execution_s
        own = outcome.execution_s if outcome.sim_s is None else outcome.sim_s
        figures = "  ".join(("" if seconds is None else f"{seconds:.1f} s").rjust(7) for seconds in (own, real))
        name = printable(outcome.name)
        if len(name) > names:
            name += f"\n{'':{_INDENT + names}}"
        room = None if width is None else width - _INDENT - names - 20
        line = f"  {name:<{names}}  {figures}  {_margin(outcome, room)}".rstrip()
        yield [("PASSED", "passed"), (f"{line}\n", "")]


def _margin(outcome: Outcome, room: int | None) -> str:
    """The check nearest to its limit, with the limit if there is room; the verdict's sentence if none has one."""
    check = checks.decisive(outcome)
    whole = printable(checks.in_words(check) if check else outcome.reason)
    short = printable(f"{check['name']} {checks.measured(check)}") if check else whole
    return clipped(whole if room is None or cells(whole) <= room else short, room)


def _times(outcome: Outcome) -> str:
    if outcome.setup_s is None or outcome.execution_s is None:
        return ""
    return f" (set-up {outcome.setup_s:.1f} s, ran {outcome.execution_s:.1f} s)"


def _wrapped(text: str, width: int | None, outcome: Outcome | None = None) -> Iterator[Piece]:
    """Indented lines, the first of which begins with the outcome; one line if there is no width."""
    whole = f"{'':{_INDENT}}{printable(text)}"
    wrapper = textwrap.TextWrapper(
        width or len(whole) + 1,
        subsequent_indent=" " * _INDENT,
        break_long_words=False,
        break_on_hyphens=False,
        replace_whitespace=False,
    )
    lines = "\n".join(wrapper.wrap(whole)) if width else whole
    if outcome:
        yield f"{outcome.outcome.upper():<6}", display.OF_OUTCOMES[outcome.outcome]
        lines = lines[6:]
    yield f"{lines}\n", ""


def _write_details(
    stream: TextIO, outcome: Outcome, verbosity: Verbosity, about: Reported | None, width: int | None
) -> None:
    """What explains an outcome, below its line."""

    def say(text: str) -> None:
        display.write_coloured(stream, _wrapped(text, width))

    is_verbose = verbosity is Verbosity.VERBOSE
    failed = [c for c in outcome.checks if not c["ok"] and not checks.only_follows(c, outcome.checks)]
    for check in outcome.checks if is_verbose else failed:
        say(checks.check_line(check, outcome.checks))
    if outcome.outcome != "passed" and about:
        for place in _places(outcome, about.plan, failed):
            stream.write(f"{'':{_INDENT}}in {printable(place)}\n")
    for note in outcome.notes:
        say(f"note: {note}")
    if is_verbose:
        for use in outcome.resources:
            say(f"{use.service}: {use.in_words()}")
        display.write_coloured(stream, _complaints(about.folder / LOGS if about else None))
    if outcome.outcome != "passed":
        stream.writelines(f"{'':{_INDENT}}| {printable(line)}\n" for line in outcome.last_lines)
        if about:
            stream.write(f"{'':{_INDENT}}open {printable(str(about.page()))}\n")


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


def _complaints(logs: Path | None) -> Iterator[Piece]:
    """The errors and warnings of each service of a test, the last ones."""
    if logs is None:
        return
    from dodo_dsl.report.viewer.log_lines import complaints

    for service, lines in itertools.groupby(complaints(logs), lambda line: line.service):
        found = list(lines)
        if len(found) > _MOST_COMPLAINTS:
            yield f"        {service}: {len(found) - _MOST_COMPLAINTS} earlier errors and warnings\n", ""
        for line in found[-_MOST_COMPLAINTS:]:
            yield f"        {service}: ", line.level
            yield f"{printable(line.text)}\n", ""


def _counts(outcomes: Sequence[Outcome]) -> Iterator[Piece]:
    """How many tests passed, failed and ended in error; what there is, in colour."""
    for between, kind, word in (("", "passed", "passed"), (", ", "failed", "failed"), (", ", "error", "in error")):
        number = sum(outcome.outcome == kind for outcome in outcomes)
        yield between, ""
        yield f"{number} {word}", display.OF_OUTCOMES[kind] if number else ""
    yield "\n", ""


def _rates(outcomes: Sequence[Outcome], tests: Mapping[str, str]) -> list[str]:
    """How often each repeated test passed."""
    found: dict[str, list[str]] = {test: [] for test in tests.values()}
    for outcome in outcomes:
        found[tests[outcome.slug]].append(outcome.outcome)
    lines = []
    for test, runs in found.items():
        passed = runs.count("passed")
        rate = f" ({passed / len(runs):.1%})" if runs else ""
        lines.append(f"{printable(test)}: {passed} of {len(runs)} passed{rate}")
    return lines


@dataclass(frozen=True)
class WrittenReport:
    """What became of a report: sentences on ``problems``, and where it is."""

    sentence: str
    problems: Sequence[str] = ()
    is_whole: bool = True


def drawable(job: Job) -> Drawable:
    """What of a job is drawn in its report."""
    return Drawable(job.plan, job.folder)


def earlier(report: Path, names: Collection[str]) -> GivenReport | None:
    """What a report has of other tests than those of these names, however often they ran; None if there is none."""
    ran = {_REPEATED.sub("", name) for name in names}
    try:
        found = results.read_given(report)
    except results.ResultsError:
        return None
    kept = [outcome for outcome in found.outcomes if _REPEATED.sub("", outcome.name) not in ran]
    slugs = {outcome.slug for outcome in kept}
    repeated = tuple(each for each in found.circumstances.repeated if each.test in slugs)
    return GivenReport(found.file, kept, Circumstances(found.circumstances.runs, repeated=repeated)) if kept else None


def save_report(
    target: NextReport,
    shown: Path,
    jobs: Sequence[Job],
    outcomes: Sequence[Outcome],
    others: GivenReport | None,
    circumstances: Circumstances,
    problems: list[str],
) -> WrittenReport:
    """Puts the report of these jobs in its place, which is ``shown`` to users; ``others`` are of an earlier run.

    ``problems`` are sentences on what could not be drawn. Where no test began, the report before stays.
    """
    if not outcomes and circumstances.not_run and (target.place / results.FILE_NAME).is_file():
        return WrittenReport(
            f"report: no test of this run began, so {shown / 'index.html'} is still that of the run before"
        )
    tests = {job.plan.slug: job.test for job in jobs}
    history = History()
    history.add((tests[outcome.slug], outcome) for outcome in outcomes)
    past = {o.slug: history.checks(o.spec, tests[o.slug], o.backend, o.clock) for o in outcomes}
    reports = [GivenReport(target.place / results.FILE_NAME, outcomes, circumstances), *([others] if others else [])]
    every = [outcome for one in reports for outcome in one.outcomes]
    kept = {outcome.slug for outcome in (others.outcomes if others else ())}
    try:
        before = {slug: runs for slug, runs in overview.read_history(target.place).items() if slug in kept}
        target.take_place([outcome.slug for outcome in outcomes], kept)
        write_summaries(target.place, every, results.joined(reports), past={**before, **past})
    except Exception as error:  # noqa: BLE001  (the outcomes are printed)
        why = getattr(error, "strerror", None) or f"{type(error).__name__}: {error}"
        return WrittenReport(f"'{shown}' cannot take the whole report: {why}", is_whole=False)
    finally:
        history.save()
    beside = f", with {count(len(kept), 'test')} of earlier runs" if kept else ""
    return WrittenReport(f"report: {shown / 'index.html'}{beside}", problems)
