"""The end of a run on disk: its report, and the history of its tests."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from dodo_dsl.cli.run.progress import count
from dodo_dsl.outcome import Outcome
from dodo_dsl.report import results
from dodo_dsl.report.next_report import NextReport
from dodo_dsl.report.report_folder import Drawable, write_report
from dodo_dsl.run.backends import Job
from dodo_dsl.run.history import History


@dataclass(frozen=True)
class WrittenReport:
    """What became of a report: sentences on ``problems``, and where it is."""

    sentence: str
    problems: Sequence[str] = ()
    is_whole: bool = True


def drawable(job: Job) -> Drawable:
    """What of a job is drawn in its report."""
    return Drawable(job.plan, job.folder)


def write(
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
