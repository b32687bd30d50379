"""A run's report folder."""

import contextlib
import errno
import functools
import os
import platform
import shutil
import subprocess
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

from dodo_dsl import atomic
from dodo_dsl.outcome import Outcome
from dodo_dsl.plan.added_services import PICTURES_FILE, RECORDING, SNAPSHOT
from dodo_dsl.plan.model import Plan
from dodo_dsl.report import comparison as report_comparison
from dodo_dsl.report import for_gitlab, overview, results, trajectory_svg
from dodo_dsl.report.comparison import Comparison
from dodo_dsl.report.duration_plot import Times
from dodo_dsl.report.duration_plot import draw as draw_times
from dodo_dsl.report.instances import worst_instances
from dodo_dsl.report.trajectory import Way, read_drive
from dodo_dsl.report.viewer import names as viewer
from dodo_dsl.spec.matrix import SLUG
from dodo_dsl.spec.registry import SUFFIX

TRAJECTORY = "trajectory.png"
TIMES = "times.svg"
OF_MACHINE = (TIMES, overview.FILE_NAME)
"""Of earlier runs on one machine."""
ATTEMPTS = "attempts"
SANDBOX_LOG = "sandbox.log"
_LONGEST_PATH = 1000


@dataclass(frozen=True)
class Drawable:
    """A test's Plan and the folder that it was compiled into, for the map under its path."""

    plan: Plan
    folder: Path


def forget(folder: Path, slugs: Sequence[str], others: Collection[str] = ()) -> int:
    """Removes the reports of an earlier run but for its tests ``others``, and those of ``slugs``; other files stay.

    Returns how many tests of the earlier run are among neither.
    """
    try:
        earlier = [outcome.slug for outcome in results.load(folder / results.FILE_NAME)]
    except results.ResultsError:
        earlier = []
    for slug in {*slugs, *earlier} - {*others}:
        if SLUG.fullmatch(slug):
            _forget_test(folder / slug)
    return len({*earlier} - {*slugs} - {*others})


def _forget_test(place: Path) -> None:
    if place.is_symlink():
        place.unlink()  # what it points to is not a report
        return
    for name in (viewer.LOGS, ATTEMPTS):
        with contextlib.suppress(OSError):
            (place / name).unlink() if (place / name).is_symlink() else shutil.rmtree(place / name)
    for name in (RECORDING, PICTURES_FILE, TRAJECTORY, trajectory_svg.FILE_NAME, SNAPSHOT, SANDBOX_LOG, *viewer.FILES):
        (place / name).unlink(missing_ok=True)
    with contextlib.suppress(OSError):  # there is none, or it holds what others put there
        place.rmdir()


def write_report(
    folder: Path,
    outcomes: Sequence[Outcome],
    tests: Mapping[str, Drawable],
    times: Mapping[str, Sequence[Times]] | None = None,
    past: overview.Past | None = None,
    circumstances: results.Circumstances = results.NO_CIRCUMSTANCES,
    place: Path | None = None,
    drawn: Mapping[str, Sequence[str]] = MappingProxyType({}),
) -> list[str]:
    """Writes the results first, draws each test, and returns sentences on what could not be drawn.

    ``times`` are those of all runs of these tests on this machine, ``past`` what their checks measured in the latest;
    they are drawn as well. ``place`` is where ``folder`` will be moved to, if it will. ``drawn`` are the slugs of tests
    that ``draw_test`` has drawn, with its sentences.
    """
    outcomes, circumstances = results.writable(tuple(outcomes)), results.writable(circumstances)
    folder.mkdir(parents=True, exist_ok=True)
    problems = [problem for outcome in outcomes for problem in drawn.get(outcome.slug, ())]
    with_room = functools.partial(_with_room, folder, drawn, problems.append)
    text = results.to_json(outcomes, circumstances)
    with_room(lambda: atomic.write_text(folder / results.FILE_NAME, text))
    missing = [outcome for outcome in outcomes if outcome.slug in tests and outcome.slug not in drawn]
    for outcome in missing:
        problems += _draw_drive(folder, outcome, tests[outcome.slug])
    for name in OF_MACHINE:
        (folder / name).unlink(missing_ok=True)
    if past:
        overview.write_history(folder, past)
    if times:
        try:
            atomic.write_text(folder / TIMES, draw_times(times, platform.node() or "this machine"))
        except Exception as error:  # noqa: BLE001  (as above)
            problems.append(f"the times of these tests cannot be drawn: {error}")
    problems += _write_shared(folder, tests)
    # first, as the pages take the most room
    with_room(lambda: write_summaries(folder, outcomes, circumstances=circumstances, place=place))
    if missing and (folder / viewer.SHARED).is_dir():
        for outcome in missing:
            problems += _write_page(folder, outcome, tests[outcome.slug])
        _write_linked(folder, outcomes, None, circumstances, place)
    return problems


def _with_room(folder: Path, drawn: Collection[str], say: Callable[[str], None], write: Callable[[], None]) -> None:
    """Writes what counts more than the pages of tests, of which some are drawn: on a full disk without them."""
    try:
        write()
    except OSError as error:
        if error.errno != errno.ENOSPC or not drawn:
            raise
        for slug in drawn:
            _without_page(folder / slug)
        write()
        say(f"the pages of the tests are left out: {error.strerror}")


def _without_page(place: Path) -> None:
    for name in viewer.FILES:
        with contextlib.suppress(OSError):
            (place / name).unlink(missing_ok=True)


def draw_test(folder: Path, outcome: Outcome, test: Drawable) -> list[str]:
    """Draws a test's drive and page in a report's ``folder``, and returns sentences on what could not be drawn."""
    outcome = results.writable(outcome)
    return [*_draw_drive(folder, outcome, test), *_write_page(folder, outcome, test)]


def _draw_drive(folder: Path, outcome: Outcome, test: Drawable) -> Iterator[str]:
    try:
        _draw(folder / outcome.slug, outcome, test)
    except Exception as error:  # noqa: BLE001  (the data comes from services, and no plot may cost a verdict)
        yield f"the drive of {outcome.name} cannot be drawn: {error}"


def _write_page(folder: Path, outcome: Outcome, test: Drawable) -> Iterator[str]:
    from dodo_dsl.report.viewer import page

    try:
        page.write(folder / outcome.slug, outcome, test.plan, test.folder)
    except Exception as error:  # noqa: BLE001  (as for pictures)
        _without_page(folder / outcome.slug)
        yield f"the page of {outcome.name} cannot be written: {error}"


def _write_shared(folder: Path, tests: Mapping[str, Drawable]) -> Iterator[str]:
    """What the pages of all tests use; without it there is no page."""
    from dodo_dsl.report.viewer import page

    try:
        if tests:
            page.write_shared(folder)
    except OSError as error:
        shutil.rmtree(folder / viewer.SHARED, ignore_errors=True)
        for slug in tests:
            _without_page(folder / slug)
        yield f"the pages of the tests cannot be written: {error}"


def write_summaries(
    folder: Path,
    outcomes: Sequence[Outcome],
    comparison: Comparison | None = None,
    circumstances: results.Circumstances = results.NO_CIRCUMSTANCES,
    place: Path | None = None,
) -> None:
    """Writes the four files about the whole run, and with a comparison that with another report.

    Without one, that of an earlier report is removed. ``place`` is where ``folder`` will be moved to. Raises OSError.
    """
    atomic.write_text(folder / results.FILE_NAME, results.to_json(outcomes, circumstances))
    atomic.write_text(folder / "metrics.txt", for_gitlab.metrics_text(outcomes))
    report_comparison.write_markdown(folder, comparison, [one.in_words() for one in worst_instances(outcomes)])
    _write_linked(folder, outcomes, comparison, circumstances, place)


def _write_linked(
    folder: Path,
    outcomes: Sequence[Outcome],
    comparison: Comparison | None,
    circumstances: results.Circumstances,
    place: Path | None,
) -> None:
    """JUnit and the page of the run, with links to what there is."""
    pictures = {o.slug: _pictures(folder, o) for o in outcomes}
    shown, pages = _shown(place or folder), _named(folder, outcomes, viewer.PAGE)
    with atomic.replacing(folder / "junit.xml") as part:
        attachments = {slug: f"{shown}/{found[0].path}" for slug, found in pictures.items() if found}
        moments = for_gitlab.to_moments(outcomes, pages, shown)
        for_gitlab.write_junit(part, outcomes, attachments, moments, circumstances.not_run, circumstances.runs)
    times = TIMES if (folder / TIMES).is_file() else ""
    files = overview.ReportFiles(
        pictures,
        _logs(folder, outcomes),
        _named(folder, outcomes, RECORDING),
        _specs(place or folder, outcomes),
        pages,
        times,
        overview.read_history(folder),
        {o.slug: way for o in outcomes if (way := trajectory_svg.read(folder / o.slug / trajectory_svg.FILE_NAME))},
    )
    page = overview.render(outcomes, files, comparison, circumstances, _branch(circumstances))
    atomic.write_text(folder / "index.html", page)
    if (folder / viewer.SHARED).is_dir():
        from dodo_dsl.report.viewer import encoded

        failed = [
            [o.slug, encoded.shown(o.name), o.outcome]
            for o in sorted(outcomes, key=overview.urgency)
            if o.outcome != "passed" and o.slug in pages
        ]
        atomic.write_text(folder / viewer.SHARED / viewer.FAILED, encoded.script(failed, viewer.FAILED_VARIABLE))


def _branch(circumstances: results.Circumstances) -> str:
    """The branch of the commit that a run was of, as the job of GitLab or the working folder is on it; else empty."""
    commits = {repository.commit for run in circumstances.runs for repository in run.repositories}
    if os.environ.get("CI_COMMIT_SHA") in commits:
        return os.environ.get("CI_COMMIT_REF_NAME", "")
    command = ["git", "--no-optional-locks", "-c", "core.fsmonitor=false", "rev-parse", "HEAD", "--abbrev-ref", "HEAD"]
    with contextlib.suppress(OSError, subprocess.SubprocessError):
        done = subprocess.run(command, capture_output=True, timeout=5, check=True) if commits else None
        commit, _, branch = done.stdout.decode(errors="replace").strip().partition("\n") if done else ("", "", "")
        return branch if commit in commits and branch != "HEAD" else ""
    return ""


def _pictures(folder: Path, outcome: Outcome) -> list[overview.ReportPicture]:
    """The pictures of a test, the most informative first: GitLab shows one beside a test case."""
    known = (
        (TRAJECTORY, f"The drive of {outcome.name} from above"),
        (SNAPSHOT, f"What the camera of {outcome.name} saw"),
    )
    place = outcome.slug
    return [
        overview.ReportPicture(f"{place}/{name}", text) for name, text in known if (folder / place / name).is_file()
    ]


def _shown(folder: Path) -> str:
    """The folder relative to the working folder, which GitLab's attachments are relative to."""
    path = folder.resolve()
    return path.relative_to(Path.cwd()).as_posix() if path.is_relative_to(Path.cwd()) else path.name


def _logs(folder: Path, outcomes: Sequence[Outcome]) -> dict[str, list[str]]:
    return {
        o.slug: [p.relative_to(folder).as_posix() for p in sorted((folder / o.slug / viewer.LOGS).glob("*.log"))]
        for o in outcomes
    }


def _named(folder: Path, outcomes: Sequence[Outcome], file: str) -> dict[str, str]:
    """The file of this name of each test that has it."""
    names = {o.slug: f"{o.slug}/{file}" for o in outcomes}
    return {slug: name for slug, name in names.items() if (folder / name).is_file()}


def _specs(folder: Path, outcomes: Sequence[Outcome]) -> dict[str, str]:
    """The specs that lie below the working folder, as seen from the report."""
    paths = {o.slug: Path.cwd() / o.spec for o in outcomes if len(o.spec) < _LONGEST_PATH}
    return {
        slug: Path(os.path.relpath(path, folder.resolve())).as_posix()
        for slug, path in paths.items()
        if path.name.endswith(SUFFIX) and path.is_file()
    }


def _draw(folder: Path, outcome: Outcome, test: Drawable) -> None:
    from dodo_dsl.report.viewer import record

    way = record.read(test.plan, folder / viewer.LOGS).way
    drive = read_drive(test.plan, test.folder, folder / RECORDING, way or Way())
    if drive is None:
        return
    from dodo_dsl.report.trajectory_plot import draw

    with atomic.replacing(folder / TRAJECTORY) as part:
        draw(drive, outcome, part)
    trajectory_svg.write(drive, outcome, folder / trajectory_svg.FILE_NAME)
