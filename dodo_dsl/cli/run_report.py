"""The end of a run: its summary, its report on disk, and the history of its tests."""

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TextIO

from dodo_dsl.cli import display
from dodo_dsl.cli.display import Verbosity
from dodo_dsl.cli.progress import count, summary_line
from dodo_dsl.diagnostics import Piece
from dodo_dsl.outcome import NotRun, Outcome
from dodo_dsl.report import comparison, results
from dodo_dsl.report.instances import worst_instances
from dodo_dsl.report.next_report import NextReport
from dodo_dsl.report.report_folder import Drawable, write_report
from dodo_dsl.run.backends import Job
from dodo_dsl.run.history import History
from dodo_dsl.terminal import printable

_MOST_NAMES = 5
_MOST_COMPLAINTS = 20
"""Of one service of a test."""


def write_summary(
    stream: TextIO,
    outcomes: Sequence[Outcome],
    tests: Mapping[str, str],
    not_run: Sequence[NotRun],
    verbosity: Verbosity = Verbosity.NORMAL,
    logs: Mapping[str, Path] | None = None,
) -> None:
    """One line per test with its explanation, then the counts; ``tests`` has each slug's name without repetition.

    ``logs`` are the folders with the logs of tests by their slugs, of which errors and warnings are shown if verbose.
    """
    is_quiet = verbosity is Verbosity.QUIET
    shown = [outcome for outcome in outcomes if not is_quiet or outcome.outcome != "passed"]
    blank = "" if is_quiet else "\n"
    stream.write(blank)
    width = max((len(outcome.name) for outcome in shown), default=0)
    for outcome in shown:
        display.write_coloured(stream, summary_line(outcome, width))
        stream.writelines(f"        note: {printable(note)}\n" for note in outcome.notes)
        if verbosity is Verbosity.VERBOSE:
            stream.writelines(
                f"        {printable(comparison.check_line(check, outcome.checks))}\n" for check in outcome.checks
            )
            stream.writelines(f"        {printable(use.service)}: {use.in_words()}\n" for use in outcome.resources)
            display.write_coloured(stream, _complaints((logs or {}).get(outcome.slug)))
        if outcome.outcome != "passed":
            stream.writelines(f"        | {printable(line)}\n" for line in outcome.last_lines)
    stream.write(blank)
    if not is_quiet:
        stream.writelines(f"{printable(worst.in_words())}\n" for worst in worst_instances(outcomes))
    if len(set(tests.values())) < len(tests):
        stream.writelines(f"{line}\n" for line in _rates(outcomes, tests))
    display.write_coloured(stream, _counts(outcomes))
    if not_run:
        names = ", ".join(test.name for test in not_run[:_MOST_NAMES])
        more = f" and {len(not_run) - _MOST_NAMES} more" if len(not_run) > _MOST_NAMES else ""
        display.write_coloured(stream, [(f"{count(len(not_run))} not run", "not run")])
        stream.write(f", as {not_run[0].reason}: {printable(names)}{more}\n")


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
    lines = []
    for test in dict.fromkeys(tests.values()):
        runs = [o.outcome for o in outcomes if tests[o.slug] == test]
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


def save_report(
    target: NextReport,
    shown: Path,
    jobs: Sequence[Job],
    backend: str,
    outcomes: Sequence[Outcome],
    others: Sequence[Outcome],
    circumstances: results.Circumstances,
    drawn: Mapping[str, Sequence[str]],
) -> WrittenReport:
    """Puts the report of these jobs in its place, which is ``shown`` to users; ``others`` are of an earlier run.

    ``drawn`` are the slugs of tests that are drawn already, with sentences on problems. Where no test began, the report
    before stays.
    """
    if not outcomes and circumstances.not_run and (target.place / results.FILE_NAME).is_file():
        return WrittenReport(
            f"report: no test of this run began, so {shown / 'index.html'} is still that of the run before"
        )
    tests = {job.plan.slug: job.test for job in jobs}
    history = History()
    history.add((tests[outcome.slug], outcome) for outcome in outcomes)
    times = history.times({(job.plan.spec, job.test) for job in jobs}, backend)
    past = {o.slug: history.checks(o.spec, tests[o.slug], o.backend, o.clock) for o in outcomes}
    drawables = {job.plan.slug: drawable(job) for job in jobs}
    try:
        target.link_others()
        every = [*outcomes, *others]
        problems = write_report(target.folder, every, drawables, times, past, circumstances, target.place, drawn)
        gone = target.take_place()
    except Exception as error:  # noqa: BLE001  (the outcomes are printed)
        why = getattr(error, "strerror", None) or f"{type(error).__name__}: {error}"
        target.stays = True
        left = "" if target.folder == target.place else f"what it has until the next run is in {target.folder}\n"
        return WrittenReport(f"'{shown}' cannot take the whole report: {why}\n{left}".rstrip("\n"), is_whole=False)
    finally:
        history.save()
    instead = f"; it replaces an earlier one with {count(gone, 'other test')}" if gone else ""
    return WrittenReport(f"report: {shown / 'index.html'}{instead}", problems)
