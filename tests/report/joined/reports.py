"""Reports as jobs leave them, made without running a test."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from dodo_dsl.outcome import Outcome
from dodo_dsl.plan.model import Plan
from dodo_dsl.report.report_folder import draw_test, write_summaries
from dodo_dsl.report.viewer import page
from dodo_dsl.report.viewer.encoded import script

PASSED = Outcome("test", "test", "t/t.dodo.yml", "sil", "closed-loop", "passed", "drove", 130, 0, "lockstep", "process")


def named(name: str, **changes: object) -> Outcome:
    slug = name.replace("[", "--").replace("]", "").replace("=", "-").replace(",", "--").replace(".", "-")
    return replace(PASSED, name=name, slug=slug, **changes)  # type: ignore[arg-type]


def check(value: float | None, ok: bool | None = None, unit: str = "m", name: str = "x", **limit: float) -> Any:
    kept = value is not None and limit.get("min", value) <= value <= limit.get("max", value)
    return {"name": name, "value": value, "limit": limit, "unit": unit, "ok": kept if ok is None else ok}


def draw(folder: Path, outcomes: Sequence[Outcome], tests: Mapping[str, tuple[Plan, Path]]) -> list[str]:
    """A report as a run writes it, with sentences on what could not be drawn."""
    problems = [problem for o in outcomes if o.slug in tests for problem in draw_test(folder, o, *tests[o.slug])]
    write_summaries(folder, outcomes)
    return problems


def write(folder: Path, outcomes: Iterable[Outcome]) -> Path:
    """A report with a recording, a picture, logs and a page of each test, which name folder and test."""
    outcomes = list(outcomes)
    for outcome in outcomes:
        place = folder / outcome.slug
        content = f"{folder.name} {outcome.slug}"
        for name in ("test.rec", "trajectory.png", "logs/application.app.log", "logs/application.app.times",
                     "attempts/1/logs/application.app.log"):  # fmt: skip
            (place / name).parent.mkdir(parents=True, exist_ok=True)
            (place / name).write_text(content)
        (place / "drive.js").write_text(drive(outcome))
        page.write_html(place)
    write_summaries(folder, outcomes)
    return folder


def drive(outcome: Outcome) -> str:
    test = {"name": outcome.name, "slug": outcome.slug, "reason": outcome.reason}
    return script({"version": page.VERSION, "test": test, "videos": [{"file": "camera-0.mp4"}]})


def tree(folder: Path) -> dict[str, bytes]:
    """The contents of all files below it."""
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}
