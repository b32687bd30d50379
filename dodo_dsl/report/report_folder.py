"""A report's folder: what is drawn of each test, and the files about all of them."""

import contextlib
import os
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from dodo_dsl import atomic
from dodo_dsl.outcome import Outcome
from dodo_dsl.plan.added_services import RECORDING, SNAPSHOT
from dodo_dsl.plan.model import Plan
from dodo_dsl.report import comparison as report_comparison
from dodo_dsl.report import for_gitlab, instances, overview, results
from dodo_dsl.report.comparison import Comparison
from dodo_dsl.report.files import FRAME, LOGS, PAGE, TRAJECTORY
from dodo_dsl.spec.registry import SUFFIX

_LONGEST_PATH = 1000


@dataclass(frozen=True)
class Drawable:
    """A test's Plan and the folder that it was compiled into, for the map under its path."""

    plan: Plan
    folder: Path


def draw_test(folder: Path, outcome: Outcome, test: Drawable) -> list[str]:
    """Draws a test's drive and page in a report's ``folder``, and returns sentences on what could not be drawn."""
    from dodo_dsl.report.viewer import page

    try:
        page.write(folder / outcome.slug, outcome, test.plan, test.folder)
    except Exception as error:  # noqa: BLE001  (the data comes from services, and no page may cost a verdict)
        (folder / outcome.slug / PAGE).unlink(missing_ok=True)
        return [f"the page of {outcome.name} cannot be written: {error}"]
    return []


def write_summaries(
    folder: Path,
    outcomes: Sequence[Outcome],
    circumstances: results.Circumstances = results.NO_CIRCUMSTANCES,
    comparison: Comparison | None = None,
    past: overview.Past | None = None,
) -> None:
    """Writes the files about the whole run, the results first, and with a comparison that with another report.

    Without one, that of an earlier report is removed. ``past`` is what checks measured in the latest runs of these
    tests on this machine. Raises OSError.
    """
    atomic.write_text(folder / results.FILE_NAME, results.to_json(outcomes, circumstances))
    atomic.write_text(folder / "metrics.txt", for_gitlab.metrics_text(outcomes))
    report_comparison.write_markdown(folder, comparison, [one.in_words() for one in instances.compared(outcomes)])
    if past is not None:
        overview.write_history(folder, past)
    pages, pictures = _named(folder, outcomes, PAGE), {o.slug: _pictures(folder, o) for o in outcomes}
    if pages:
        from dodo_dsl.report.viewer import page

        page.write_shared(folder, [o for o in sorted(outcomes, key=overview.urgency) if o.slug in pages])
    shown = _shown(folder)
    with atomic.replacing(folder / "junit.xml") as part:
        attachments = {slug: f"{shown}/{found[0].path}" for slug, found in pictures.items() if found}
        moments = for_gitlab.to_moments(outcomes, pages, shown)
        for_gitlab.write_junit(part, outcomes, attachments, moments, circumstances.not_run, circumstances.runs)
    files = overview.ReportFiles(
        pictures,
        _logs(folder, outcomes),
        _named(folder, outcomes, RECORDING),
        _specs(folder, outcomes),
        pages,
        overview.read_history(folder),
    )
    html = overview.render(outcomes, files, comparison, circumstances, _branch(circumstances))
    atomic.write_text(folder / "index.html", html)


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
    """The pictures of a test, the most informative first: it stands beside the test, also in GitLab."""
    known = (
        (TRAJECTORY, f"The drive of {outcome.name} from above"),
        (FRAME, f"What the camera of {outcome.name} saw"),
        (SNAPSHOT, f"What the camera of {outcome.name} saw"),
    )
    place = outcome.slug
    known = known[1:] + known[:1] if outcome.kind == "perception" else known
    return [
        overview.ReportPicture(f"{place}/{name}", text) for name, text in known if (folder / place / name).is_file()
    ]


def _shown(folder: Path) -> str:
    """The folder relative to the working folder, which GitLab's attachments are relative to."""
    path = folder.resolve()
    return path.relative_to(Path.cwd()).as_posix() if path.is_relative_to(Path.cwd()) else path.name


def _logs(folder: Path, outcomes: Sequence[Outcome]) -> dict[str, list[str]]:
    return {
        o.slug: [p.relative_to(folder).as_posix() for p in sorted((folder / o.slug / LOGS).glob("*.log"))]
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
