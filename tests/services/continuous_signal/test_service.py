from pathlib import Path
from typing import Any

import pytest

from dodo_dsl.opendlv.envelope import Envelope, encode_frame
from dodo_dsl.opendlv.message_set import MessageSet
from services.base import Context, Flags
from services.base.flags import load_manifest, parse
from services.continuous_signal.service import ContinuousSignal
from tests.services.continuous_signal.test_target import recording
from tests.services.process import ROOT

STEERING = "opendlv.proxy.GroundSteeringRequest"
START = 1_700_000_000_000_000
SPARSE = ("--min-coverage=0", "--max-gap=100", "--max-delay=100")
FLAGS = (f"--message={STEERING}", "--field=groundSteering", "--max-mean=0.05")


@pytest.fixture
def table(tmp_path: Path) -> Path:
    path = tmp_path / "ramp.csv"
    path.write_text("time,groundSteering\n0,0\n10,1\n")
    return path


def flags(*words: str) -> Flags:
    return parse(load_manifest(ROOT / "services" / "continuous_signal"), ["--cid=128", *FLAGS, *words])


def service(*words: str) -> ContinuousSignal:
    return ContinuousSignal(Context("continuous-signal", flags(*words), MessageSet.standard()))


def steering(value: float) -> Any:
    return MessageSet.standard().type(STEERING)(groundSteering=value)


def test_a_table_is_met_from_the_begin_of_the_test(table: Path) -> None:
    judge = service(f"--target={table}", "--sender=3", "--min-samples=1", *SPARSE)
    assert set(judge.inputs) == {(STEERING, 3)}
    judge.begin(START)
    judge.inputs[STEERING, 3](steering(0.5), START + 5_000_000)
    judge.end_of_input(START + 6_000_000)
    assert judge.verdict is not None and judge.verdict.outcome == "passed"


def test_a_recording_is_met_at_its_sample_times(tmp_path: Path) -> None:
    path = recording(tmp_path, (102_000_000, 3, 0.25), (104_000_000, 3, 0.75))
    judge = service(f"--target={path}", "--sender=3", "--min-samples=1", "--align=sample-time", "--from=2.5", *SPARSE)
    judge.begin(START)
    judge.inputs[STEERING, 3](steering(9.0), 102_400_000)
    judge.inputs[STEERING, 3](steering(0.5), 103_000_000)
    judge.update(START + 61_000_000)
    assert judge.verdict is not None and judge.verdict.outcome == "passed"
    assert {check.name: check.value for check in judge.verdict.checks}["samples"] == 1


def test_frames_are_the_pictures_of_a_recorded_target(tmp_path: Path) -> None:
    """Four pictures of camera 2 from the first sample on, and one answer to the first of them."""
    samples = recording(tmp_path, *((second * 1_000_000, 3, 0.4) for second in (101, 106))).read_bytes()
    pictures = (Envelope(1055, b"", 1, 0, second * 1_000_000, 2) for second in range(101, 106))
    path = tmp_path / "pictures.rec"
    path.write_bytes(samples + b"".join(map(encode_frame, pictures)))
    words = (f"--target={path}", "--sender=3", "--align=sample-time", "--band=25%", "--min-frame-share=0.3", *SPARSE)
    judge = service(*words, "--video-sender=2", "--min-samples=1")
    judge.begin(START)
    judge.inputs[STEERING, 3](steering(0.5), 102_000_000)
    judge.end_of_input(START + 5_000_000)
    assert judge.verdict is not None and judge.verdict.outcome == "failed"
    said = "the share of frames within 25 % of the target is 0.25 (at least 0.3), and 3 had no sample"
    assert said in judge.verdict.reason


def test_a_live_target_has_its_own_message(table: Path) -> None:
    judge = service("--target-sender=9", "--min-samples=1", *SPARSE)
    assert set(judge.inputs) == {(STEERING, 0), (STEERING, 9)}
    judge.begin(START)
    judge.inputs[STEERING, 9](steering(0.5), START)
    judge.inputs[STEERING, 9](steering(0.5), START + 2_000_000)
    judge.inputs[STEERING, 0](steering(0.5), START + 1_000_000)
    judge.end_of_input(START + 3_000_000)
    assert judge.verdict is not None and judge.verdict.outcome == "passed"


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ((), "no target: give --target, or --target-sender for a live one"),
        (("--target=TABLE", "--min-share=0.9"), "--min-share needs --band, the distance that counts as inside"),
        (("--target=TABLE", "--min-frame-share=0.9"), "--min-frame-share needs --band, the distance that counts"),
        (
            ("--target=TABLE", "--band=0.1", "--band-floor=0.1"),
            "--band-floor needs a --band that is a share of the target",
        ),
        (("--target=TABLE", "--band-floor=5%"), "'5%', expected number"),
        (("--target=TABLE", "--band=-5%"), "'-5%', expected number or share, at least 0"),
        (("--target=TABLE", "--from=3", "--until=3"), "--until=3 is not after --from=3"),
        (("--target=TABLE", "--target-field=angle"), "found time, groundSteering"),
        (("--target-sender=9", "--target-field=angle"), "has no field 'angle'; it has groundSteering"),
    ],
)
def test_flags_that_leave_something_open_are_refused(table: Path, words: tuple[str, ...], said: str) -> None:
    with pytest.raises(ValueError) as raised:
        service(*(word.replace("TABLE", str(table)) for word in words))
    assert said in str(raised.value)
