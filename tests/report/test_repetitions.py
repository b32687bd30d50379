"""What repetitions of a test in lockstep have to have in common."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from dodo_dsl.opendlv.envelope import Envelope, encode_frame
from dodo_dsl.opendlv.message_set import MessageSet
from dodo_dsl.outcome import Outcome
from dodo_dsl.report.repetitions import path_of, repeated
from tests.report.test_report_folder import OUTCOME


def check(name: str, value: float | None, ok: bool = True) -> dict[str, Any]:
    return {"name": name, "value": value, "limit": {"max": 1.0}, "unit": "m", "ok": ok}


FIRST = replace(
    OUTCOME, clock="lockstep", outcome="passed", reason="reached it", sim_s=4.0, execution_s=1.0,
    checks=(check("gap", 0.1), check("gap", 0.2), check("slow-answers", 0.0)),
)  # fmt: skip


def among(folder: Path, *outcomes: Outcome) -> dict[str, list[str]]:
    runs = [replace(outcome, slug=f"test--run-{n}") for n, outcome in enumerate(outcomes, 1)]
    return repeated((folder / "compiled", run, folder / run.slug) for run in runs)


def test_what_measures_the_machine_may_differ(tmp_path: Path) -> None:
    slower = replace(FIRST, execution_s=9.0, notes=("slow",), checks=(*FIRST.checks[:2], check("slow-answers", 0.4)))
    assert among(tmp_path, FIRST, slower) == {"test--run-1": []}
    failed = replace(FIRST, outcome="failed", reason="9 answers took 2 s", checks=(check("slow-answers", 2, ok=False),))
    assert among(tmp_path, failed, replace(failed, reason="8 answers took 3 s")) == {"test--run-1": []}


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"outcome": "failed"}, "outcome: passed, failed, passed"),
        ({"reason": "near it"}, "reason: reached it, near it, reached it"),
        ({"sim_s": 4.1}, "test time: 4.0 s, 4.1 s, 4.0 s"),
        ({"sim_s": None}, "test time: 4.0 s, none, 4.0 s"),
        ({"checks": (check("gap", 0.1), check("gap", 0.3))}, "gap (1): 0.2 m, 0.3 m, 0.2 m"),
        ({"checks": (check("gap", 0.1),)}, "gap (1): 0.2 m, none, 0.2 m"),
    ],
    ids=str,
)
def test_any_other_value_that_differs_is_named(change: dict[str, Any], words: str, tmp_path: Path) -> None:
    assert among(tmp_path, FIRST, replace(FIRST, **change), FIRST) == {"test--run-1": [words]}


def test_the_path_is_compared_by_its_messages_alone(tmp_path: Path) -> None:
    messages = MessageSet.standard()

    def recorded(run: int, *names: str) -> None:
        file = tmp_path / f"test--run-{run}" / "test.rec"
        file.parent.mkdir()
        frames = (Envelope(messages.id(name), b"", run, 0, 7, 0) for name in names)
        file.write_bytes(b"".join(map(encode_frame, frames)))

    frame, other = "opendlv.sim.Frame", "opendlv.proxy.GroundSteeringRequest"
    for run, names in ((1, (frame,)), (2, (other, frame)), (3, (frame, frame))):
        recorded(run, *names)
    paths = [path_of(tmp_path / f"test--run-{run}" / "test.rec") for run in (1, 2, 3, 4)]
    assert paths[0] == paths[1] != paths[2]
    assert paths[3] == "none"
    assert among(tmp_path, FIRST, FIRST, FIRST) == {"test--run-1": [f"path: {', '.join(paths[:3])}"]}


def test_in_real_time_and_of_single_runs_nothing_is_compared(tmp_path: Path) -> None:
    steady = replace(FIRST, clock="realtime")
    assert among(tmp_path, steady, replace(steady, sim_s=5.0)) == {}
    assert among(tmp_path, FIRST) == {}
