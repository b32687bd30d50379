import subprocess
import sys
import time
from itertools import pairwise
from pathlib import Path

from dodo_dsl.opendlv.envelope import Envelope
from dodo_dsl.opendlv.recording import read_envelopes
from dodo_dsl.opendlv.session import Session
from tests.services.built import refusal
from tests.services.process import PATIENCE, ROOT, running, send


def until_recorded(path: Path, count: int) -> list[Envelope]:
    deadline = time.monotonic() + PATIENCE
    while len(found := list(read_envelopes(path))) < count:
        assert time.monotonic() < deadline, f"{len(found)} of {count} messages were recorded"
        time.sleep(0.01)
    return found


def test_every_message_is_there_even_after_a_kill(cid: int, tmp_path: Path) -> None:
    path = tmp_path / "drive.rec"
    strange = Envelope(4711, b"\x0d\xa4\x01", 5, 0, -1_500_000, 9)
    with Session(cid) as session, running("rec_recorder", tmp_path, f"--cid={cid}", f"--rec={path}") as recorder:
        send(session, "dodo.TestBegin", seed=3)
        send(session, "opendlv.proxy.PedalPositionRequest", sender_stamp=2, sample_time=17, position=0.5)
        session.send_envelope(strange)
        recorded = until_recorded(path, 3)
        recorder.kill()
    assert [e.data_type for e in recorded] == [2900, 1086, 4711]
    assert (recorded[1].sample_time, recorded[1].sender_stamp) == (17, 2)
    assert recorded[2]._replace(received=0) == strange
    assert all(0 < a.received <= b.received for a, b in pairwise(recorded))
    assert list(read_envelopes(path)) == recorded


def test_a_file_that_is_there_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "drive.rec"
    path.write_bytes(b"dear")
    assert refusal("rec_recorder", f"--rec={path}") == f"{path} exists and is not overwritten"
    assert path.read_bytes() == b"dear"


def test_it_starts_without_numpy() -> None:
    code = "import sys, services.rec_recorder.__main__; print('numpy' in sys.modules)"
    output = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert output.stdout == "False\n"
