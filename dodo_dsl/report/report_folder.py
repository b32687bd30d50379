"""A report's folder: what is drawn of each test, and the files about all of them."""

import os
from collections.abc import Sequence
from pathlib import Path

from dodo_dsl import atomic
from dodo_dsl.outcome import Outcome
from dodo_dsl.plan.added_services import RECORDING, SNAPSHOT
from dodo_dsl.plan.model import Plan
from dodo_dsl.report import for_gitlab, overview, results
from dodo_dsl.report.comparison import Comparison
from dodo_dsl.report.files import FRAME, LOGS, PAGE, TRAJECTORY
from dodo_dsl.report.overview import LinkedFiles
from dodo_dsl.spec.registry import SUFFIX

_LONGEST_PATH = 1000


def draw_test(folder: Path, outcome: Outcome, plan: Plan, compiled: Path) -> list[str]:
    """Draws a test's drive and page in a report's ``folder``, and returns sentences on what could not be drawn.

    ``compiled`` is the folder of the compiled test, for the map under its path.
    """
    from dodo_dsl.report.viewer import page

    try:
        page.write(folder / outcome.slug, outcome, plan, compiled)
    except Exception as error:  # noqa: BLE001  (the data comes from services, and no page may cost a verdict)
        (folder / outcome.slug / PAGE).unlink(missing_ok=True)
        return [f"the page of {outcome.name} cannot be written: {error}"]
    return []


def write_summaries(
    folder: Path,
    outcomes: Sequence[Outcome],
    circumstances: results.Circumstances = results.NO_CIRCUMSTANCES,
    comparison: Comparison | None = None,
    past: overview.Past = overview.NO_PAST,
) -> None:
    """Writes the files about the whole run, the results first, and with a comparison that with another report.

    ``past`` are the latest runs of its tests on this machine. Raises OSError.
    """
    atomic.write_text(folder / results.FILE_NAME, results.to_json(outcomes, circumstances))
    atomic.write_text(folder / "metrics.txt", for_gitlab.metrics_text(outcomes))
    files = {o.slug: _files(folder, o) for o in outcomes}
    if any(found.drive for found in files.values()):
        from dodo_dsl.report.viewer import page

        page.write_shared(folder)
    atomic.write_bytes(folder / "junit.xml", for_gitlab.junit(outcomes, files, _shown(folder), circumstances))
    html = overview.render(outcomes, files, comparison, circumstances, past)
    atomic.write_text(folder / "index.html", html)


def _files(folder: Path, outcome: Outcome) -> LinkedFiles:
    """What there is of a test, the most informative picture first: it stands beside the test, also in GitLab."""
    place, camera = folder / outcome.slug, f"What the camera of {outcome.name} saw"
    known = [(TRAJECTORY, f"The drive of {outcome.name} from above"), (SNAPSHOT, camera), (FRAME, camera)]
    known = known[1:] + known[:1] if outcome.kind == "perception" or outcome.level == "dil" else known
    spec = Path.cwd() / outcome.spec[:_LONGEST_PATH]
    is_spec = spec.name.endswith(SUFFIX) and spec.is_file()
    recording, page = (f"{outcome.slug}/{name}" if (place / name).is_file() else "" for name in (RECORDING, PAGE))
    return LinkedFiles(
        [(f"{outcome.slug}/{name}", text) for name, text in known if (place / name).is_file()],
        [path.relative_to(folder).as_posix() for path in sorted((place / LOGS).glob("*.log"))],
        recording,
        Path(os.path.relpath(spec, folder.resolve())).as_posix() if is_spec else "",
        page,
    )


def _shown(folder: Path) -> str:
    """The folder relative to the working folder, which GitLab's attachments are relative to."""
    path = folder.resolve()
    return path.relative_to(Path.cwd()).as_posix() if path.is_relative_to(Path.cwd()) else path.name
