"""How long an application said nothing in real time."""

from pathlib import Path

import pytest

from dodo_dsl.plan.model import Application, ApplicationService, Flag, Plan, PlannedService
from dodo_dsl.run.test_recording import long_pause
from tests.run.recorded.made import EPOCH, begin, message, write
from tests.run.scripted import plan

STEERING = "opendlv.proxy.GroundSteeringRequest"


def of(freq: str, output: str = STEERING) -> Plan:
    flags = (Flag("name", "video0.argb", "memory"), *([Flag("freq", freq)] if freq else []))
    camera = PlannedService("environment", "camera", "virtual-camera", "x", (), flags)
    application = Application(".", (ApplicationService("driver", outputs=("team.Unknown", output)),))
    return plan(services=(camera,), application=application)


@pytest.mark.parametrize(
    ("period", "pause", "freq", "output", "told"),
    [
        (0.1, 1.5, "10", STEERING, "for 1.5 s, as long as 15 frames, after 2.0 s"),
        (0.1, 1.5, "10", f"{STEERING}/0", "for 1.5 s, as long as 15 frames, after 2.0 s"),
        (0.1, 1.5, "10", f"{STEERING}/3", ""),
        (0.1, 1.5, "", STEERING, "for 1.5 s, as long as 15 frames, after 2.0 s"),
        (0.1, 0.9, "10", STEERING, ""),
        (0.01, 0.5, "10", STEERING, ""),
        (0.5, 3.0, "10", STEERING, ""),
    ],
)
def test_pauses(tmp_path: Path, period: float, pause: float, freq: str, output: str, told: str) -> None:
    """Before the begin nothing counts, nor a message that comes less often than frames do."""
    times = [-50.0, *(period * n for n in range(1, 21)), *(20 * period + pause + period * n for n in range(20))]
    sent = [message(STEERING, 0, EPOCH + round(t * 1e6)) for t in times]
    rec = write(tmp_path / "test.rec", begin(EPOCH), *sent)
    found = long_pause(of(freq, output), tmp_path, rec)
    assert found == (f"application service 'driver' sent no GroundSteeringRequest {told}" if told else "")


def test_a_few_messages_are_no_answers_to_frames(tmp_path: Path) -> None:
    rec = write(tmp_path / "test.rec", begin(EPOCH), *(message(STEERING, 0, EPOCH + n**5) for n in range(9)))
    assert long_pause(of("10"), tmp_path, rec) == ""
