import random
import struct
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from dodo_dsl.opendlv.envelope import Envelope, encode_frame
from dodo_dsl.opendlv.odvd import STANDARD, STANDARD_0_9, load
from tests.opendlv.test_against_libcluon import some_value
from tests.rec.conftest import BEGIN, MESSAGES, dodo_rec, message

REC2CSV = Path(sys.executable).with_name("cluon-rec2csv")


def tables(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.glob("*.csv")}


def libcluons(recording: Path, odvd: Path, folder: Path) -> dict[str, bytes]:
    pytest.importorskip("pycluon")
    folder.mkdir()
    command = [REC2CSV, f"--rec={recording}", f"--odvd={odvd}"]
    subprocess.run(command, cwd=folder, check=True, capture_output=True, timeout=60)
    return tables(folder)


def ours(recording: Path, folder: Path, *words: str) -> dict[str, bytes]:
    code, _, stderr = dodo_rec("export", recording, "--csv", "-o", folder, *words)
    assert code == 0, stderr
    return tables(folder)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["track-1-2025-05-08.rec", "sim-2023-04-27.rec", "cones-2020-05-15.rec"])
def test_recordings_of_others_as_libcluon_has_them(
    name: str, shared_data: Callable[[str], Path], tmp_path: Path
) -> None:
    path = shared_data(name)
    assert ours(path, tmp_path / "new", "--messages=1.0") == libcluons(path, STANDARD, tmp_path / "their-new")
    old = ours(path, tmp_path / "old", "--messages=0.9")
    for file, text in libcluons(path, STANDARD_0_9, tmp_path / "their-old").items():
        assert old[file] == text


@pytest.mark.slow
def test_every_message_unsorted_with_every_kind_of_number(tmp_path: Path) -> None:
    rng = random.Random(55)
    frames = []
    special = list(struct.unpack("<4f", bytes.fromhex("0000c07f0000c0ff0000807f01000080")))  # nan, -nan, inf, tiny
    for _ in range(40):
        for definition in load(STANDARD):
            values = {field.name: some_value(field, rng) for field in definition.fields}
            for field in definition.fields:
                if field.type in ("float", "double") and rng.random() < 0.3:
                    values[field.name] = rng.choice([*special, 1e-9, 123456789.0, -0.0, 1e20, rng.random()])
            time = rng.choice([0, rng.randrange(-5_000_000, 5_000_000), BEGIN + rng.randrange(10**9)])
            payload = MESSAGES.encode(MESSAGES.type(definition.id)(**values))
            frames.append(encode_frame(Envelope(definition.id, payload, time + 1, -time, time, rng.randrange(3))))
    path = tmp_path / "all.rec"
    path.write_bytes(b"".join(frames))
    assert ours(path, tmp_path / "ours") == libcluons(path, STANDARD, tmp_path / "theirs")


def test_messages_of_inner_messages_and_letters(tmp_path: Path, record: Callable[..., Path]) -> None:
    odvd = tmp_path / "own.odvd"
    odvd.write_text(
        "message team.Point [id = 8001] { float x [id = 1]; int16 y [id = 2]; }\n"
        "message team.Cone [id = 8000] { team.Point at [id = 1]; char letter [id = 2]; uint64 big [id = 3]; }\n"
    )
    point = b"\x0d\x00\x00\x80\x3f\x10\x05"
    payload = b"\x0a" + bytes([len(point)]) + point + b"\x10\x41\x18" + b"\xff" * 9 + b"\x01"
    path = record([Envelope(8000, payload, 1, 2, time, 7) for time in (3, 1, 2)])
    (text,) = ours(path, tmp_path / "ours", f"--messages={odvd}").values()
    head, *rows = text.decode().splitlines()
    assert head.endswith("sampleTimeStamp.seconds;sampleTimeStamp.microseconds;at.x;at.y;letter;big;")
    assert rows == [f"0;1;0;2;0;{time};1;-3;A;18446744073709551615;" for time in (1, 2, 3)]


def test_what_is_left_out_is_told(tmp_path: Path, record: Callable[..., Path]) -> None:
    good = message("opendlv.proxy.DistanceReading", BEGIN, distance=2.5)
    path = record([good, good._replace(payload=b"\x0d\x00"), good._replace(data_type=1144)])
    code, stdout, stderr = dodo_rec("export", path, "--csv", "-o", tmp_path / "out")
    assert (code, stdout) == (0, f"{tmp_path / 'out'}: 1 tables with 1 rows\n")
    assert stderr == (
        "dodo rec: skipped unknown messages: 1144\n"
        "dodo rec: skipped 1 payload of opendlv.proxy.DistanceReading that cannot be decoded\n"
    )
    assert dodo_rec("export", record([good._replace(data_type=1144)]), "--csv").code == 2


def test_the_default_folder_and_what_is_there(
    tmp_path: Path, record: Callable[..., Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    record([message("opendlv.proxy.DistanceReading", BEGIN)])
    assert dodo_rec("export", "drive.rec", "--csv").code == 0
    again = dodo_rec("export", "drive.rec", "--csv")
    text = "'drive/opendlv.proxy.DistanceReading-0.csv' exists already; --force replaces it"
    assert (again.code, again.stderr) == (2, f"dodo rec: {text}\n")
    assert dodo_rec("export", "drive.rec", "--csv", "--force").code == 0
    assert "is not a folder" in dodo_rec("export", "drive.rec", "--csv", "-o", "drive.rec").stderr
    assert sorted(path.name for path in tmp_path.iterdir()) == ["drive", "drive.rec"]
