"""Recordings go both ways between DoDo and libcluon's own tools: recorder, filter and player."""

import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from dodo_dsl.opendlv.envelope import Envelope
from dodo_dsl.opendlv.recording import Recording, read_envelopes
from dodo_dsl.opendlv.session import Session
from tests.rec.conftest import BEGIN, dodo_rec, message, video

pytestmark = pytest.mark.slow

PATIENCE = 20.0


def tool_path(name: str) -> Path:
    """The tool itself: the script of its name in the environment starts it as a child, which would outlive its end."""
    pycluon = pytest.importorskip("pycluon")
    return Path(pycluon.__file__).parent / "bin" / name


@contextmanager
def tool(name: str, *words: str | Path, output: Path) -> Iterator["subprocess.Popen[bytes]"]:
    command = [tool_path(name), *words]
    with output.open("wb") as stdout:
        process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=stdout, stderr=subprocess.DEVNULL)
        try:
            yield process
        finally:
            process.terminate()
            process.wait(PATIENCE)


def drive() -> list[Envelope]:
    requests = [
        message("opendlv.proxy.GroundSteeringRequest", BEGIN + 10_000 * i, i % 3, groundSteering=i / 8)
        for i in range(40)
    ]
    return sorted([*requests, *video(4)], key=lambda envelope: envelope.sample_time)


def until(condition: Callable[[], bool]) -> None:
    deadline = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.01)


def test_what_libcluon_records_is_read(cid: int, tmp_path: Path) -> None:
    path, sent = tmp_path / "theirs.rec", drive()
    with tool("cluon-OD4toStdout", f"--cid={cid}", output=path) as recorder, Session(cid) as session:
        hello = message("dodo.TestBegin", 1)
        until(lambda: bool(session.send_envelope(hello)) and path.stat().st_size > 0)
        for envelope in sent:
            session.send_envelope(envelope)
        until(lambda: (list(read_envelopes(path)) or [hello])[-1].sample_time == sent[-1].sample_time)
        assert recorder.poll() is None
    found = [envelope for envelope in read_envelopes(path) if envelope.data_type != hello.data_type]
    assert [envelope._replace(received=0) for envelope in found] == [envelope._replace(received=0) for envelope in sent]
    assert all(envelope.received > BEGIN for envelope in found)
    assert "4 packets, 4 decoded" in dodo_rec("info", path).stdout


def test_what_we_cut_is_played_by_libcluon(cid: int, record: Callable[..., Path], tmp_path: Path) -> None:
    path, part = record(drive(), after=b"??"), tmp_path / "part.rec"
    assert dodo_rec("cut", path, "-o", part, "--message", "1090/1", "--end", "0.3").code == 0
    with Session(cid) as session, tool("cluon-replay", f"--cid={cid}", part, output=tmp_path / "log") as player:
        player.wait(PATIENCE)
        heard = [envelope for envelope in iter(lambda: session.receive(0.5), None) if envelope.data_type == 1090]
    with Recording(part) as recording:
        expected = [envelope.payload for envelope in recording.envelopes()]
    assert [envelope.payload for envelope in heard] == expected and len(expected) == 10


def test_libcluons_filter_and_our_cut_agree(record: Callable[..., Path], tmp_path: Path) -> None:
    path = record(drive())
    kept = subprocess.run(
        [tool_path("cluon-filter"), "--keep=1055/0,1090/2"], input=path.read_bytes(), capture_output=True, check=True
    ).stdout
    assert dodo_rec("cut", path, "-o", tmp_path / "ours.rec", "--message=1055/0", "--message=1090/2").code == 0
    assert (tmp_path / "ours.rec").read_bytes() == kept
