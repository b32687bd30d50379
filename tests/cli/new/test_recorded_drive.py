"""``dodo new --rec``: a test of a recording of one's own, which compiles at once and judges what was recorded."""

import shutil
from pathlib import Path

import pytest
import yaml

from dodo_dsl import package_data
from dodo_dsl.cli.recorded_drive import SIGNALS
from dodo_dsl.opendlv.envelope import Envelope, encode_frame
from dodo_dsl.opendlv.message_set import MessageSet
from dodo_dsl.opendlv.recording import read_envelopes
from tests.cli.new.test_command import contents, dodo

SHIPPED = package_data.registry() / "recordings/kiwi-track.rec"
STEERING = "opendlv.proxy.GroundSteeringRequest"


@pytest.fixture
def empty(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "dodo.yml").write_text("dodo: 1\nregistry: [tests]\napplication: compose.yml\n")
    (tmp_path / "compose.yml").write_text(
        "services: {car: {image: car, command: --cid=111, x-dodo: {in: [], out: [opendlv.sim.Frame, "
        f"{STEERING}, opendlv.proxy.PedalPositionRequest]}}}}}}\n"
    )
    return tmp_path


def spec(folder: Path, name: str) -> dict[str, object]:
    found = yaml.safe_load((folder / f"tests/{name}/{name}.dodo.yml").read_text())
    return {
        **found["environment"]["drive"]["with"],
        **found["evaluation"]["signal"]["with"],
        "clock": found.get("clock"),
    }


def write(path: Path, *streams: tuple[str, int, list[float]], step: int = 100_000) -> None:
    """A recording with a message of each value every ``step`` us, by name and sender stamp."""
    messages = MessageSet.standard()
    frames = []
    for name, sender, values in streams:
        for number, value in enumerate(values):
            time = 1_700_000_000_000_000 + number * step
            message = messages.type(name)(**{SIGNALS[name]: value})
            frames.append(encode_frame(Envelope(messages.id(name), messages.encode(message), time, time, time, sender)))
    path.write_bytes(b"".join(frames))


@pytest.mark.parametrize("file", ["drive.rec", "my drive: 2 #1.rec"])
@pytest.mark.thorough
def test_cameras_senders_and_target_are_looked_up(empty: Path, file: str) -> None:
    shutil.copy(SHIPPED, empty / file)
    code, out, err = dodo("new", "mine", "--level", "dil", "--rec", file)
    assert (code, err) == (0, "")
    assert f"{file}: 15 s, judged: groundSteering of {STEERING}/0\n" in out
    assert dodo("compile", "--check") == (0, "1 test checked: no problems\n", "")
    found = spec(empty, "mine")
    assert found["rec"] == found["target"] == f"../recordings/{file}"
    assert (found["video-sender"], found["target-sender"], found["clock"]) == (0, 0, "lockstep")
    assert (found["max-mean"], found["max-time"]) == (0.022, "25 s")
    assert (empty / "tests/recordings" / file).read_bytes() == SHIPPED.read_bytes()


@pytest.mark.thorough
def test_the_replay_shows_pictures_where_the_application_looks(empty: Path) -> None:
    compose = empty / "compose.yml"
    compose.write_text(compose.read_text().replace("--cid=111", "--cid=111 --name=img.argb --name.bgr=img.bgr"))
    shutil.copy(SHIPPED, empty / "drive.rec")
    assert dodo("new", "mine", "--level", "dil", "--rec", "drive.rec")[0] == 0
    assert (spec(empty, "mine")["name.argb"], spec(empty, "mine")["name.bgr"]) == ("img.argb", "img.bgr")
    assert dodo("compile", "--check") == (0, "1 test checked: no problems\n", "")


@pytest.mark.thorough
def test_a_recording_that_is_there_is_not_copied(empty: Path) -> None:
    shutil.copy(SHIPPED, empty / "drive.rec")
    assert dodo("new", "one", "--rec", "drive.rec")[0] == 0
    assert "wrote tests/recordings" not in dodo("new", "two", "--rec", "drive.rec")[1]
    assert "wrote tests/recordings" not in dodo("new", "three", "--rec", "tests/recordings/drive.rec")[1]
    (empty / "other").mkdir()
    write(empty / "other/drive.rec", (STEERING, 0, [0.1] * 20))
    before = contents(empty)
    code, _, err = dodo("new", "four", "--rec", "other/drive.rec")
    assert (code, err) == (2, "dodo new: 'tests/recordings/drive.rec' exists already; nothing was written\n")
    assert contents(empty) == before


@pytest.mark.thorough
def test_a_recording_without_pictures_is_played_in_lockstep(empty: Path) -> None:
    """The preferred message with enough samples is judged, by half of what the best constant reaches."""
    streams = [(STEERING, 3, [0.1] * 5), ("opendlv.proxy.PedalPositionRequest", 4, [0.1, 0.3] * 20)]
    write(empty / "drive.rec", *streams, ("opendlv.proxy.PedalPositionRequest", 7, [0.1] * 12))
    code, out, err = dodo("new", "mine", "--rec", "drive.rec")
    assert (code, err) == (0, "")
    assert "drive.rec: 4 s, judged: position of opendlv.proxy.PedalPositionRequest/4\n" in out
    found = spec(empty, "mine")
    assert (found["clock"], found["align"], found["sample-times"]) == ("lockstep", "begin", "test")
    assert (found["max-mean"], found["target-sender"]) == (0.050, 4)
    assert dodo("compile", "--check")[0] == 0


@pytest.mark.thorough
def test_pictures_alone_have_to_be_answered(empty: Path) -> None:
    """By the message that the application sends; the test compiles, and its answers are those to the recording."""
    pictures = [e for e in read_envelopes(SHIPPED) if e.data_type == 1055][:40]
    (empty / "drive.rec").write_bytes(b"".join(map(encode_frame, pictures)))
    code, out, err = dodo("new", "mine", "--level", "dil", "--rec", "drive.rec")
    assert (code, err) == (0, "")
    assert f"judged: answers to pictures by {STEERING}\n" in out
    assert dodo("compile", "--check") == (0, "1 test checked: no problems\n", "")
    found = yaml.safe_load((empty / "tests/mine/mine.dodo.yml").read_text())
    assert (found["clock"], found["evaluation"]["answers"]) == ("lockstep", {"uses": "responds", "with": {
        "message": STEERING, "field": "groundSteering", "min-share": "95 %",
        "max-time": "14 s"}})  # fmt: skip


@pytest.mark.thorough
def test_what_is_written_compiles(empty: Path) -> None:
    """Whatever a recording holds, and however its file is called; breaks without a signal are played shorter."""
    compose = empty / "compose.yml"
    compose.write_text(compose.read_text().replace("--cid=111", "--cid=111 --name=video0.argb"))
    pictures = [encode_frame(e) for e in read_envelopes(SHIPPED) if e.data_type == 1055]
    later = [e._replace(sample_time=e.sample_time + 3 * 3600 * 10**6) for e in read_envelopes(SHIPPED)]
    gap = [*pictures[:10], *(encode_frame(e) for e in later if e.data_type == 1055)]
    names = ("break.rec", "Run [1].REC", "no suffix", "a\nb.rec", "true", "-.rec", "${X}'\".rec")
    for number, name in enumerate(names):
        (empty / name).write_bytes(b"".join(pictures[:12] if number else gap))
        code, out, err = dodo("new", f"t{number}", f"--rec={name}")
        assert (code, err) == (0, "")
    streams: tuple[tuple[str, list[float], int], ...] = (
        (STEERING, [0.1] * 10, 1_000),
        (STEERING, [float("nan")] * 10 + [1e30, -1e-12], 59 * 60 * 10**6),
        ("opendlv.proxy.PedalPositionRequest", [-5.0] * 40, 10_000),
    )
    for number, (message, values, step) in enumerate(streams):
        write(empty / f"s{number}", (message, 3, values), step=step)
        assert dodo("new", f"s{number}", "--rec", f"s{number}")[0] == 0
    code, out, _ = dodo("compile", "--check")
    assert (code, out.splitlines()[-1][:17], "error" in out) == (0, "10 tests checked:", False)
    assert "timeout: 3" in (empty / "tests/t0/t0.dodo.yml").read_text()


@pytest.mark.thorough
def test_a_matrix_of_recordings_makes_one_test_over_all(empty: Path) -> None:
    shutil.copy(SHIPPED, empty / "drive.rec")
    assert dodo("new", "mine", "--rec", "drive.rec")[0] == 0
    (empty / "tests/recordings/wet").mkdir()
    shutil.copy(SHIPPED, empty / "tests/recordings/wet/b.2.rec")
    file = empty / "tests/mine/mine.dodo.yml"
    text = file.read_text().replace("../recordings/drive.rec", '"${matrix.drive}"')
    file.write_text(text + "matrix: {drive: [../recordings/drive.rec, ../recordings/wet/b.2.rec]}\n")
    assert dodo("compile")[0] == 0
    plans = sorted((empty / "generated").glob("*/test.json"))
    slugs = ["mine--drive-recordings-drive-rec", "mine--drive-recordings-wet-b-2-rec"]
    assert [plan.parent.name for plan in plans] == slugs
    assert [
        f"recordings/{name}" in plan.read_text() for plan, name in zip(plans, ("drive.rec", "wet/b.2.rec"), strict=True)
    ] == [True] * 2
    file.write_text(file.read_text().replace("b.2.rec", "c.rec"))
    assert "parameter 'rec': there is no file or folder '../recordings/wet/c.rec'" in dodo("compile", "--check")[1]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--rec", "none.rec"], "none.rec: No such file or directory"),
        (["--rec", "compose.yml"], "compose.yml is not a recording"),
        (
            ["--rec", "few.rec"],
            "'few.rec' has no signal to judge, expected 10 or more messages of one of opendlv.proxy.",
        ),
        (["--rec", "empty.rec"], "'empty.rec' has no messages to play"),
        (["--rec", "bag.mcap"], "'bag.mcap' is a bag of ROS 2, expected a recording: dodo rec import bag.mcap"),
        (
            ["--rec", "other.rec"],
            "'other.rec' has no signal to judge, expected 10 or more messages of one of opendlv.p",
        ),
        (["--rec", "few.rec", "--level", "sil"], "a recording is played at level dil, and"),
        (["--rec", "few.rec", "--kind", "perception"], "a recording is played at level dil, and"),
        (["--rec", "few.rec", "--extends", "x"], "--level, --kind and --rec do not apply with --extends"),
    ],
)
@pytest.mark.thorough
def test_what_makes_no_test_is_said(empty: Path, words: list[str], said: str) -> None:
    write(empty / "few.rec", (STEERING, 0, [0.1] * 9))
    write(empty / "empty.rec")
    write(empty / "other.rec", ("opendlv.proxy.AngleRequest", 0, [0.1] * 10))
    before = contents(empty)
    code, out, err = dodo("new", "mine", *words)
    assert (code, out, contents(empty)) == (2, "", before)
    assert err.startswith(f"dodo new: {said}")


@pytest.mark.parametrize("time", [0, 1])
@pytest.mark.thorough
def test_a_recording_with_times_that_cannot_be_right_makes_no_test(empty: Path, time: int) -> None:
    write(empty / "drive.rec", (STEERING, 0, [0.1] * 20))
    first, *others = read_envelopes(empty / "drive.rec")
    wrong = first._replace(sent=time, received=time, sample_time=time)
    (empty / "drive.rec").write_bytes(b"".join(map(encode_frame, [wrong, *others])))
    code, _, err = dodo("new", "mine", "--rec", "drive.rec")
    assert code == 2
    assert err.startswith(f"dodo new: 'drive.rec' cannot be played: message 1 ({STEERING}/0")
