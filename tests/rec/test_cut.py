from collections.abc import Callable
from pathlib import Path

import pytest

from dodo_dsl.opendlv.recording import read_envelopes
from tests.rec.conftest import BEGIN, dodo_rec, message

STEERING, DISTANCE = "opendlv.proxy.GroundSteeringRequest", "opendlv.proxy.DistanceReading"


@pytest.fixture
def drive(record: Callable[..., Path]) -> Path:
    envelopes = [
        message(name, BEGIN + second * 1_000_000, stamp)
        for second in (0, 1, 3, 2)
        for name, stamp in ((STEERING, 0), (DISTANCE, 0), (DISTANCE, 1))
    ]
    return record(envelopes, after=b"??")


@pytest.mark.parametrize(
    ("words", "rows"),
    [
        (["--start", "1", "--end", "3"], [3, 4, 5, 9, 10, 11]),
        (["--start", f"{BEGIN / 1e6 + 3:.6f}"], [6, 7, 8]),
        (["--message", f"{DISTANCE}/1", "--message", "1090"], [0, 2, 3, 5, 6, 8, 9, 11]),
        (["--message", DISTANCE, "--end", "1s"], [1, 2]),
        (["--message", f"{DISTANCE}/1", "--start", "2"], [8, 11]),
        ([], list(range(12))),
    ],
)
def test_a_part_byte_for_byte(drive: Path, tmp_path: Path, words: list[str], rows: list[int]) -> None:
    output = tmp_path / "deep" / "part.rec"
    assert dodo_rec("cut", drive, "-o", output, *words) == (
        0,
        f"{output}: {len(rows)} of 12 messages\n",
        f"dodo rec: {drive}: skipped 2 bytes at byte {drive.stat().st_size - 2}: no frame begins here\n",
    )
    whole = list(read_envelopes(drive))
    assert list(read_envelopes(output)) == [whole[row] for row in rows]
    assert [path.name for path in output.parent.iterdir()] == ["part.rec"]


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (["--start", "9"], "nothing selected: no message of {drive} is within --start, --end, --message"),
        (
            ["--message", "1086", "--end", "1"],
            "nothing selected: no message of {drive} is within --start, --end, --message",
        ),
        (["--message", "DistanceReading"], "there is no message 'DistanceReading': did you mean '" + DISTANCE + "'?"),
        (
            ["--message", f"{DISTANCE}/x"],
            f"'{DISTANCE}/x' is not a message: expected a sender stamp, a number, after the slash",
        ),
    ],
)
def test_selections_of_nothing(drive: Path, tmp_path: Path, words: list[str], text: str) -> None:
    output = tmp_path / "part.rec"
    code, stdout, stderr = dodo_rec("cut", drive, "-o", output, *words)
    assert (code, stdout, stderr.splitlines()[-1]) == (2, "", "dodo rec: " + text.format(drive=drive))
    assert not output.exists()


def test_times_that_are_none(drive: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for text in ("soon", "-1", "nan", "inf"):
        assert dodo_rec("cut", drive, "-o", "x", f"--start={text}").code == 2
        assert f"'{text}' is not a " in capsys.readouterr().err


def test_what_is_there_is_replaced_only_with_force(drive: Path, tmp_path: Path) -> None:
    output = tmp_path / "part.rec"
    output.write_bytes(b"dear")
    before = drive.read_bytes()
    assert dodo_rec("cut", drive, "-o", output).code == 2
    assert output.read_bytes() == b"dear"
    assert "is the recording itself" in dodo_rec("cut", drive, "-o", drive, "--force").stderr
    assert dodo_rec("cut", drive, "-o", output, "--force").code == 0
    assert len(list(read_envelopes(output))) == 12 and drive.read_bytes() == before
