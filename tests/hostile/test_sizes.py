"""Inputs that unfold to more than a machine has, and floods."""

import json
import struct
import time
import zlib
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from dodo_dsl.opendlv.address import IMAGE
from dodo_dsl.opendlv.assets import map_file
from dodo_dsl.opendlv.assets.map_file import MAX_OVERLAYS, read_map
from dodo_dsl.opendlv.assets.mesh_text import MAX_BYTES, MAX_TRIANGLES, MAX_VERTICES
from dodo_dsl.opendlv.assets.problem import InputError
from dodo_dsl.opendlv.envelope import Envelope
from dodo_dsl.opendlv.message_set import MessageSet
from dodo_dsl.opendlv.odvd import OdvdError
from dodo_dsl.opendlv.picture_size import MAX_PIXELS
from dodo_dsl.opendlv.recording import Recording
from dodo_dsl.rec.frames import decoded
from dodo_dsl.run.protocol import Flooded, Noted
from dodo_dsl.run.run_state import MOST_NOTES, RunState
from dodo_dsl.run.service_protocol import read
from dodo_dsl.spec import registry
from dodo_dsl.spec.registry import RegistryError, locate
from services.camera.sources import FileCamera
from services.rec_recorder import model
from services.rec_recorder.model import FloodError, RecordingFile, Traffic
from services.scene import scene
from services.scene.meshes import load_obj
from services.scene.textures import load_picture
from services.virtual_camera.optics import load_with_alpha
from tests.drive.applications import dodo, program, results
from tests.drive.variants import registry as registry_of_dodo
from tests.drive.variants import variant
from tests.rec.conftest import BEGIN, HEIGHT, WIDTH, message, record, video
from tests.run.scripted import plan

__all__ = ["record"]
SIDE = 20_000


def png(width: int, height: int) -> bytes:
    """A whole file of one colour and one bit a pixel, which compresses a thousandfold."""
    packed = zlib.compressobj(9)
    rows = b"".join(packed.compress(b"\0" * (1 + -(-width // 8))) for _ in range(height)) + packed.flush()
    parts = ((b"IHDR", struct.pack(">IIBBBBB", width, height, 1, 0, 0, 0, 0)), (b"IDAT", rows), (b"IEND", b""))
    chunks = (struct.pack(">I", len(d)) + n + d + struct.pack(">I", zlib.crc32(n + d)) for n, d in parts)
    return b"\x89PNG\r\n\x1a\n" + b"".join(chunks)


def jpeg(width: int, height: int) -> bytes:
    """The begin of a file: a comment that looks like a small frame, then the frame's header."""
    lie = b"\xff\xc0\x00\x0b\x08\x00\x10\x00\x10\x01\x01\x11\x00"
    comment = b"\xff\xfe" + struct.pack(">H", 2 + len(lie)) + lie
    return b"\xff\xd8" + comment + b"\xff\xc2\x00\x0b\x08" + struct.pack(">HH", height, width) + b"\x01\x01\x11\x00"


BOMBS = {"bomb.png": png(SIDE, SIDE), "bomb.jpg": jpeg(SIDE, SIDE)}
TOO_LARGE = f"an image of {SIDE} x {SIDE} pixels, expected at most {MAX_PIXELS} in all"
UNREADABLE = (b"", b"\x89PNG\r\n\x1a\n", b"\xff\xd8", b"\xff\xd8" + b"\xff" * 50, b"BM" + bytes(60))
FACES = b"v 0 0 0\nv 1 0 0\nv 0 1 0\n" + b"f 1 2 3\n" * (MAX_TRIANGLES + 1)
OVERLAY = {"name": "a", "dimension": [1, 1], "textureFile": "map.json", "instances": [[0, 0]] * (MAX_OVERLAYS + 1)}
DOUBLED = "\n".join(
    f"message a.M{n} [id = {5000 + n}] {{ a.M{n + 1} x [id = 1]; a.M{n + 1} y [id = 2]; }}" for n in range(30)
)


def map_of(path: Path) -> object:
    return read_map(path.parent)


def frame_of(path: Path) -> object:
    return FileCamera(path, 640, 480)


PICTURES = (load_picture, load_with_alpha, frame_of)
REFUSED: list[tuple[str, bytes, Callable[[Path], object], str]] = [
    *((name, data, read, TOO_LARGE) for name, data in BOMBS.items() for read in PICTURES),
    *(("a.png", data, load_picture, "not a readable image, expected PNG or JPEG") for data in UNREADABLE),
    ("a.obj", FACES, load_obj, f"more than {MAX_TRIANGLES} faces"),
    ("a.obj", b" \tv 0 0 0\n" * (MAX_VERTICES + 1), load_obj, f"more than {MAX_VERTICES} vertices"),
    ("a.obj", b"# " + b"x" * MAX_BYTES, load_obj, f"{MAX_BYTES + 2} bytes, expected at most {MAX_BYTES}"),
    ("map.json", json.dumps({"overlay": [OVERLAY]}).encode(), map_of, f"{MAX_OVERLAYS + 1} instances of overlays"),
    ("a.odvd", f"{DOUBLED}\nmessage a.M30 [id = 4999] {{ uint8 x [id = 1]; }}".encode(), MessageSet.load,
     r"a\.odvd:15:9: 'a\.M14' unfolds to more than 100000 fields"),
]  # fmt: skip
"""A file, what is in it, who reads it, and what is said: by its header, or as it is counted, before it unfolds."""


@pytest.mark.parametrize(("name", "content", "read", "said"), REFUSED)
def test_what_unfolds_is_refused(
    tmp_path: Path, name: str, content: bytes, read: Callable[[Path], object], said: str
) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises((InputError, OdvdError, ValueError), match=said):
        read(tmp_path / name)


def registry_of(folder: Path) -> object:
    for number in range(30):
        (folder / str(number)).mkdir(exist_ok=True)
    return locate([], [folder])


def obstacles_of(folder: Path) -> object:
    written = [{"name": name, "lines": [[0, 0, 1, 1]] * 5} for name in "ab"]  # evaluators measure the distance to each
    (folder / "map.json").write_text(json.dumps({"obstacles": written}))
    return map_file.read_obstacles(folder)


def shipped_scene(_folder: Path) -> object:
    return scene.load_scene(Path(__file__).parents[2] / "tests_registry" / "maps" / "static-rig")


@pytest.mark.parametrize(
    ("module", "limit", "most", "read", "said"),
    [
        (scene, "MAX_TRIANGLES", 10, shipped_scene, "map.json: more than 10 triangles of models"),
        (scene, "MAX_TEXTURE_BYTES", 10, shipped_scene, "map.json: more than 10 bytes of"),
        (map_file, "MAX_LINES", 9, obstacles_of, "10 lines of obstacles, expected at most 9"),
        (registry, "MAX_FOLDERS", 20, registry_of, "has more than 20 folders: name the folder with the tests"),
    ],
)
def test_what_is_read_in_all_is_limited(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, module: Any, limit: str, most: int, read: Any, said: str
) -> None:
    read(tmp_path)
    monkeypatch.setattr(module, limit, most + 1 if limit == "MAX_LINES" else 1000_000_000)
    read(tmp_path)
    monkeypatch.setattr(module, limit, most)
    with pytest.raises((InputError, RegistryError), match=said):
        read(tmp_path)


def test_frames_that_a_message_calls_too_large_are_not_decoded(record: Callable[..., Path]) -> None:
    size = {"format": "h264", "width": 16_000, "height": 16_000}
    large = message("opendlv.proxy.ImageReading", BEGIN, 3, data=b"\0\0\1\x65", **size)
    told: list[str] = []
    with Recording(record([large, large, *video(1)])) as recording:
        found = [frame for _, frame in decoded(recording, recording.rows(messages=[IMAGE]), told.append)]
    assert [frame and (frame.width, frame.height) for frame in found] == [None, None, (WIDTH, HEIGHT)]
    (sentence,) = told
    assert sentence.startswith("frames cannot be decoded: an image of 16000 x 16000 pixels, expected at most")


class Clock:
    now = 5_000_000

    def __call__(self) -> int:
        return self.now


def envelope(number: int, stamp: int = 0, size: int = 100) -> Envelope:
    return Envelope(number, bytes(size), 1, 1, 1, stamp)


def test_a_recording_ends_at_its_limit_and_names_what_fills_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "test.rec"
    with closing(RecordingFile(path, Traffic(100_000, Clock(), lambda: 0, lambda id_: f"a.M{id_}"))) as recording:
        recording.write(envelope(7))
        with pytest.raises(FloodError, match=r"the recording would be larger than 0\.1 MB, most of it a\.M9/3"):
            for _ in range(2000):
                recording.write(envelope(9, 3))
        recording.write(envelope(9, 3))
    assert 99_000 < path.stat().st_size <= 100_000
    event = read("dodo-recorder", False, capsys.readouterr().out.encode())
    assert isinstance(event, Flooded) and (event.message, event.sender_stamp, event.too_fast) == ("a.M9", 3, False)
    assert 0.99 < event.share < 1


def test_messages_of_a_second_are_limited_in_all_and_of_a_kind() -> None:
    clock, lost = Clock(), [0]
    counter = Traffic(10**9, clock, lambda: lost[0], str)
    for second in range(3):
        clock.now = 5_000_000 + second * 1_000_000
        for stamp in (1, 2):
            for _ in range(model.MOST_OF_A_KIND):
                counter.add(envelope(5, stamp), 10)
    with pytest.raises(FloodError, match="more than 10000 messages of a kind came within a second, most of it 5/1"):
        counter.add(envelope(5, 1), 10)
    clock.now += 1_000_000
    counter.add(envelope(5), 10)
    lost[0] = model.MOST_PER_SECOND
    with pytest.raises(FloodError, match="more than 20000 messages came within a second, most of it 5/0"):
        counter.add(envelope(5), 10)


def test_notes_do_not_grow_without_end() -> None:
    found = RunState(plan(), time.monotonic)
    for number in range(1000):
        found.take(Noted(str(number)))
    assert len(found.notes) == MOST_NOTES + 1
    assert found.notes[-1] == f"there are more notes, and only {MOST_NOTES} are kept"


APPLICATIONS = {
    "keeps the lock": (
        "memory = attached(name)\nmemory.wait()\nwith memory.lock():\n    time.sleep(600)\n",
        ("failed", "the application keeps service 'camera' from its shared memory: "),
    ),
    "fills the recording": (
        "while True:\n    session.send(reading, None, 3)\n    time.sleep(0.005)\n",
        ("error", "the recording would be larger than 5 MB: "),
    ),
}
"""What they do, and what becomes of their test."""
BEGIN_OF_ALL = """
import sys, time
from dodo_dsl.opendlv.session import Session
from dodo_dsl.opendlv.shared_memory import SharedMemory, SharedMemoryError
cid, name = (word.partition("=")[2] for word in sys.argv[1:])
session = Session(int(cid))
reading = session.messages.type("opendlv.proxy.ImageReading")(format="h264", width=4, height=4, data=bytes(60000))
def attached(name):
    while True:
        try:
            return SharedMemory.attach(name)
        except SharedMemoryError:
            time.sleep(0.05)
"""


@pytest.mark.realtime
@pytest.mark.parametrize("kind", APPLICATIONS)
def test_whole_applications(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: str) -> None:
    """Applications that fill the recording, or keep a camera's lock, end their own test."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("DODO_LEASES", str(tmp_path / "leases"))
    keys = {"clock": "realtime", "record": {"limit": "5 MB"}}
    spec = variant(registry_of_dodo(tmp_path), "sil-closed-straight", "sil-small", **keys)
    (tmp_path / "app.py").write_text(BEGIN_OF_ALL + APPLICATIONS[kind][0])
    application = program(tmp_path, "python", "app.py")
    dodo("run", str(spec), "--application", str(application), "--report", str(tmp_path / "report"), code=(1, 3))
    (test,) = results(tmp_path / "report").values()
    result, reason = APPLICATIONS[kind][1]
    assert (test["outcome"], test["reason"][: len(reason)]) == (result, reason), test
