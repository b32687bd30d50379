"""Outputs that must not replace, input that must not be read, state that others could change, and text that commands.

Each attack is an entry of a table: a command and what it must say, or a text and a way in which it reaches a terminal.
"""

import json
import os
import re
import socket
import stat
import subprocess
import sys
from collections.abc import Callable, Iterator
from io import StringIO
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dodo_dsl import atomic
from dodo_dsl.cli.main import main
from dodo_dsl.opendlv import regular_file
from dodo_dsl.report.report_folder import forget
from dodo_dsl.run import leases
from dodo_dsl.run.history import History
from dodo_dsl.state_folder import UnsafeFolder, secured
from dodo_dsl.terminal import HarmlessStream, harmless_stream, json_text, printable
from tests.rec.conftest import BEGIN, Answer, dodo_rec, message, record, video

__all__ = ["record"]
ROOT = Path(__file__).parents[2]
STRANGER = 54_321


@pytest.fixture
def strange(tmp_path: Path) -> Iterator[dict[str, Path]]:
    """What is no file, by its kind; the devices are copies, so that a test that fails breaks no machine."""
    places = {name: tmp_path / f"strange-{name}" for name in ("fifo", "socket", "folder", "link", "device")}
    os.mkfifo(places["fifo"])
    listener = socket.socket(socket.AF_UNIX)
    listener.bind(str(places["socket"]))
    places["folder"].mkdir()
    try:
        os.mknod(places["device"], 0o666 | stat.S_IFCHR, os.makedev(1, 3))
    except PermissionError:
        places["device"].symlink_to("/dev/null")
    places["link"].symlink_to(places["fifo"])
    yield places
    listener.close()


KINDS = {
    "fifo": "a FIFO, which no output replaces",
    "socket": "a socket, which no output replaces",
    "folder": "Is a directory",
    "link": "a FIFO, which no output replaces",
    "device": "a device, which no output replaces",
}


def kinds_below(folder: Path) -> dict[str, int]:
    return {path.name: stat.S_IFMT(path.lstat().st_mode) for path in folder.glob("strange-*")}


@pytest.mark.parametrize("kind", KINDS)
def test_a_cut_replaces_nothing_but_a_file(record: Callable[..., Path], strange: dict[str, Path], kind: str) -> None:
    before = kinds_below(strange[kind].parent)
    answer = dodo_rec("cut", record(video(1)), "-o", strange[kind], "--force")
    assert answer == Answer(2, "", f"dodo rec: '{strange[kind]}' cannot take the result: {KINDS[kind]}\n")
    assert kinds_below(strange[kind].parent) == before


@pytest.mark.parametrize(
    "place", ["/dev/dodo-new.rec", "/dev/shm/../dodo-new.rec", "/proc/self/comm", "/sys/dodo-new.rec"]
)
def test_the_kernel_s_folders_take_no_output(record: Callable[..., Path], place: str) -> None:
    before = Path(place).lstat() if os.path.lexists(place) else None
    code, stdout, stderr = dodo_rec("cut", record(video(1)), "-o", place, "--force")
    assert (code, stdout) == (2, "")
    kernels = "/" + place.split("/")[1]
    assert (
        stderr == f"dodo rec: '{place}' cannot take the result: {kernels} belongs to the kernel, and takes no output\n"
    )
    after = Path(place).lstat() if os.path.lexists(place) else None
    assert (before and before.st_ino) == (after and after.st_ino)


@pytest.mark.parametrize("kind", ["fifo", "socket", "device", "link", "folder"])
@pytest.mark.parametrize("words", [("--csv",), ("--coco", "--all")], ids=["csv", "coco"])
def test_an_export_replaces_nothing_but_files(
    record: Callable[..., Path], strange: dict[str, Path], kind: str, words: tuple[str, ...], tmp_path: Path
) -> None:
    name = "opendlv.proxy.ImageReading-0.csv" if words[0] == "--csv" else "annotations.json"
    target = tmp_path / "tables"
    target.mkdir()
    strange[kind].rename(target / name)
    before = (target / name).lstat().st_ino
    code, _, stderr = dodo_rec("export", record(video(1)), *words, "-o", target, "--force")
    assert (code, "cannot take the result" in stderr) == (2, True), stderr
    assert (target / name).lstat().st_ino == before
    assert [path.name for path in target.iterdir()] == [name]


def files_into(path: Path) -> None:
    with atomic.files_into(path.parent) as stage:
        (stage / path.name).write_text("new")


def new_folder(path: Path) -> None:
    with atomic.new_folder(path):
        pass


WRITERS: dict[str, Callable[[Path], object]] = {
    "write_text": lambda path: atomic.write_text(path, "new"),
    "write_bytes": lambda path: atomic.write_bytes(path, b"new", durable=True),
    "files_into": files_into,
    "appended": lambda path: atomic.appended(path).close(),
    "new_folder": new_folder,
}


@pytest.mark.parametrize("kind", ["fifo", "socket", "device", "link"])
@pytest.mark.parametrize("writer", WRITERS)
def test_no_writer_replaces_what_is_no_file(strange: dict[str, Path], kind: str, writer: str) -> None:
    before = strange[kind].lstat().st_ino
    with pytest.raises(OSError, match=f"strange-{kind}"):
        WRITERS[writer](strange[kind])
    assert strange[kind].lstat().st_ino == before


def test_logs_follow_no_symlink(tmp_path: Path) -> None:
    (tmp_path / "mine").write_text("mine")
    (tmp_path / "log").symlink_to(tmp_path / "mine")
    with pytest.raises(OSError, match="Too many levels of symbolic links"):
        atomic.appended(tmp_path / "log")
    assert (tmp_path / "mine").read_text() == "mine"


@pytest.mark.parametrize("link", ["", "files", "files/maps"])
def test_compiling_follows_no_symlink(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, link: str) -> None:
    """What a repository has in the place of output: a way to files elsewhere, which would be removed."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "dodo.yml").write_text(f"dodo: 1\napplication: {ROOT}/examples/kiwi/docker-compose.yml\n")
    (tmp_path / "theirs").mkdir()
    (tmp_path / "theirs" / "precious").write_text("untouched")
    place = tmp_path / "generated" / "sil-closed-straight" / link
    place.parent.mkdir(parents=True)
    place.symlink_to(tmp_path / "theirs")
    code, output = dodo("compile", "sil-closed-straight")
    assert (code, "a symlink, which no output follows" in output) == (2, True), output
    assert [path.name for path in (tmp_path / "theirs").iterdir()] == ["precious"]


@pytest.mark.parametrize("link", ["sil-a", "sil-a/logs", "sil-a/attempts"])
def test_an_earlier_report_is_removed_without_following_symlinks(tmp_path: Path, link: str) -> None:
    (tmp_path / "theirs" / "logs").mkdir(parents=True)
    (tmp_path / "theirs" / "logs" / "precious").write_text("untouched")
    place = tmp_path / "report" / link
    place.parent.mkdir(parents=True)
    place.symlink_to(tmp_path / "theirs")
    forget(tmp_path / "report", ["sil-a"])
    assert (tmp_path / "theirs" / "logs" / "precious").read_text() == "untouched"
    assert not place.exists()


@pytest.mark.parametrize("parameter", ["rec", "snapshot"])
@pytest.mark.parametrize(
    "name",
    ["/root/.ssh/authorized_keys", "../a.rec", "/etc/cron.d/a", "/tmp/../etc/a", "a/b", ".bashrc", "", "/dev/null"],
)
def test_a_spec_names_no_output_elsewhere(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, parameter: str, name: str
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "dodo.yml").write_text("dodo: 1\nregistry: [.]\n")
    values = {"rec": "a.rec", "memories": ["a"], parameter: name}
    use = {"uses": "rec-recorder", "with": values}
    (tmp_path / "a.dodo.yml").write_text(f"dodo: 1\nname: a\nenvironment: {json.dumps({'more': use})}\n")
    _, output = dodo("compile", "--check")
    assert f"error[path-escape]: parameter '{parameter}' is '{name}', expected a file's name without" in output, output


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can make another user's folder")
def test_an_empty_folder_of_another_user_stays(tmp_path: Path) -> None:
    (tmp_path / "theirs").mkdir()
    os.chown(tmp_path / "theirs", STRANGER, STRANGER)
    with pytest.raises(FileExistsError):
        new_folder(tmp_path / "theirs")
    assert (tmp_path / "theirs").stat().st_uid == STRANGER


READERS = {
    "info": ("rec", "info", "{}"),
    "cut": ("rec", "cut", "{}", "-o", "new.rec"),
    "export": ("rec", "export", "{}", "--csv"),
    "messages": ("rec", "info", "drive.rec", "--messages", "{}"),
    "truth": ("rec", "export", "drive.rec", "--coco", "--truth", "{}", "-o", "out"),
    "judge": ("judge", "{}", "--spec", "sil-closed-straight"),
    "application": ("compile", "--check", "--application", "{}"),
    "spec": ("compile", "--check", "{}"),
    "picture": ("rig", "truth", "emulated", "-o", "t.json", "--picture", "{}", "--box", "a", "1", "1", "2", "2"),
}
"""Commands that read a file; each has to end at once, with a sentence that names it."""


@pytest.mark.parametrize("kind", ["fifo", "socket", "link", "device"])
@pytest.mark.parametrize("reader", READERS)
def test_input_is_a_file(
    record: Callable[..., Path], strange: dict[str, Path], kind: str, reader: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = record(video(1)).parent
    monkeypatch.chdir(folder)
    (folder / "dodo.yml").write_text("dodo: 1\n")
    code, output = dodo(*(word.format(strange[kind]) for word in READERS[reader]))
    assert code in (2, 3), output
    assert "strange-" in output and "Traceback" not in output and "internal error" not in output


@pytest.mark.parametrize("kind", ["fifo", "socket", "folder", "device"])
@pytest.mark.parametrize("name", ["results.json", "test.json", "dodo.yml"])
def test_files_that_are_found_are_files(
    strange: dict[str, Path], tmp_path: Path, kind: str, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    strange[kind].rename(tmp_path / name)
    words = {"results.json": ("report", "."), "test.json": ("run", "--compiled", "."), "dodo.yml": ("list",)}[name]
    code, output = dodo(*words)
    assert "Traceback" not in output and "internal error" not in output
    assert code == 2 or name == "dodo.yml", output


def test_a_reader_takes_no_more_than_it_may(tmp_path: Path) -> None:
    (tmp_path / "a").write_bytes(bytes(1001))
    with pytest.raises(OSError, match="larger than 1000 bytes"):
        regular_file.content(tmp_path / "a", 1000)
    assert len(regular_file.content(tmp_path / "a", 1001)) == 1001


# State


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("DODO_LEASES", str(tmp_path / "leases"))
    return tmp_path / "leases"


def test_state_is_made_for_its_user_alone(folder: Path) -> None:
    before = os.umask(0)
    try:
        assert leases.folder() == folder
    finally:
        os.umask(before)
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700


@pytest.mark.parametrize("mode", [0o777, 0o1777, 0o703])
def test_state_that_all_can_write_is_refused(folder: Path, mode: int) -> None:
    folder.mkdir()
    folder.chmod(mode)
    with pytest.raises(UnsafeFolder, match="all users can write it, and so DoDo's state: chmod 700"):
        leases.try_lease("cid-130", {})
    assert list(folder.iterdir()) == []


def test_state_behind_a_symlink_is_refused(folder: Path) -> None:
    (folder.parent / "elsewhere").mkdir(mode=0o700)
    folder.symlink_to(folder.parent / "elsewhere")
    with pytest.raises(UnsafeFolder, match="not a folder, and DoDo keeps no state where it points to"):
        leases.try_lease("cid-130", {})


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can make another user's folder")
def test_state_of_another_user_is_refused(folder: Path) -> None:
    folder.mkdir(mode=0o700)
    os.chown(folder, STRANGER, STRANGER)
    with pytest.raises(UnsafeFolder, match=f"belongs to user {STRANGER}, who could change DoDo's state"):
        leases.try_lease("cid-130", {})


@pytest.mark.skipif(os.geteuid() == 0, reason="of root's folders the group may write")
def test_a_group_loses_its_write_permission(folder: Path) -> None:
    folder.mkdir()
    folder.chmod(0o770)
    assert stat.S_IMODE(secured(folder).stat().st_mode) == 0o750


@pytest.mark.parametrize("name", ["cid-130.lock", "cid-130.PID.json"])
def test_a_planted_symlink_is_not_written_through(folder: Path, name: str) -> None:
    folder.mkdir(mode=0o700)
    victim = folder.parent / "victim"
    victim.write_text("untouched")
    (folder / name.replace("PID", str(os.getpid()))).symlink_to(victim)
    try:
        lease = leases.try_lease("cid-130", {})
        assert lease is not None
        lease.release()
    except OSError as error:
        assert "symbolic links" in str(error)
    assert victim.read_text() == "untouched"


def test_a_record_that_never_ends_is_not_read(folder: Path) -> None:
    folder.mkdir(mode=0o700)
    os.mkfifo(folder / "cid-130.1.json")
    assert leases.holder("cid-130") == "another process"
    assert list(leases.orphans("cid-")) == []


def test_history_follows_no_symlink_and_waits_for_no_fifo(tmp_path: Path) -> None:
    victim = tmp_path / "victim"
    victim.write_text("")
    (tmp_path / "link").symlink_to(victim)
    os.mkfifo(tmp_path / "fifo")
    for name in ("link", "fifo"):
        history = History(tmp_path / name)
        history._saved = -1
        history.save()
    assert victim.read_text() == ""


# Terminals

ATTACKS = {
    "title": "\x1b]0;owned\x07",
    "colour": "\x1b[31mred",
    "c1": "\x9b31m",
    "bell": "\a",
    "carriage return": "passed\r",
    "right to left": "\u202egnp.exe",
    "github": "\n::error::you failed",
    "github behind blanks": "\n  ::set-output name=a::b",
    "github of old": "##[error]you failed",
    "azure": "##vso[task.complete result=Succeeded;]",
    "gitlab": "\nsection_start:1:a[collapsed=true]\r\x1b[0K",
    "verdict": "\n1 passed, 0 failed, 0 in error",
}
FORBIDDEN = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u202e]|^\s*::|##\[|##vso\[|^1 passed", re.MULTILINE)


def dodo(*words: str) -> tuple[int, str]:
    stdout = StringIO()
    code = main(words, stdout, stdout)
    return code, stdout.getvalue()


@pytest.mark.parametrize("attack", ATTACKS)
def test_no_text_commands_a_stream(attack: str) -> None:
    stream = StringIO()
    out = harmless_stream(stream)
    assert harmless_stream(out) is out
    for part in (ATTACKS[attack], "\n", ATTACKS[attack][1:], "\nend\n"):
        out.write(part)
    assert not FORBIDDEN.search(stream.getvalue().replace("\n1 passed", "\n")), repr(stream.getvalue())
    assert stream.getvalue().endswith("\nend\n")
    assert not FORBIDDEN.search(printable("x" + ATTACKS[attack]).replace("##", ""))


@pytest.mark.parametrize("attack", ATTACKS)
def test_json_says_the_same_and_commands_nothing(attack: str) -> None:
    stream = StringIO()
    harmless_stream(stream).write(json_text({ATTACKS[attack]: [ATTACKS[attack], "ü"]}))
    assert not FORBIDDEN.search(stream.getvalue())
    assert json.loads(stream.getvalue()) == {ATTACKS[attack]: [ATTACKS[attack], "ü"]}


def test_commands_in_pieces_are_none() -> None:
    stream = StringIO()
    out = HarmlessStream(stream)
    for part in ("a::b\n", " ", ":", ":error::x\n", "\t:", "ok\n"):
        out.write(part)
    assert stream.getvalue() == "a::b\n : :error::x\n\t:ok\n"


PIECES = st.sampled_from(["#", "##", "[", "##[", "vso", "vso[", ":", "::", "::error::", " ", "\t", "\n", "a", "\x1b["])


@given(st.lists(PIECES | st.text(max_size=5), max_size=12))
def test_no_pieces_become_a_command(pieces: list[str]) -> None:
    stream = StringIO()
    out = harmless_stream(stream)
    for piece in pieces:
        assert out.write(piece) == len(piece)
    assert not re.search(r"^[ \t]*::|##\[|##vso\[", stream.getvalue(), re.MULTILINE), repr(stream.getvalue())
    assert all(c.isprintable() or c in "\n\t" for c in stream.getvalue())


@pytest.mark.parametrize("attack", ATTACKS)
def test_a_recording_commands_no_terminal(record: Callable[..., Path], attack: str) -> None:
    image = message("opendlv.proxy.ImageReading", BEGIN, 7, data=b"x", format=ATTACKS[attack], width=4, height=4)
    for words in (("info",), ("export", "--coco", "--all", "-o", "out")):
        _, stdout, stderr = dodo_rec(words[0], record([image], f"{attack[:3]}.rec"), *words[1:])
        assert not FORBIDDEN.search(stdout + stderr), repr(stderr)


@pytest.mark.parametrize("attack", ATTACKS)
@pytest.mark.parametrize("place", ["name", "description", "rig", "service", "file"])
def test_a_repository_commands_no_terminal(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, attack: str, place: str
) -> None:
    monkeypatch.chdir(tmp_path)
    text = json.dumps(ATTACKS[attack] + "x")
    spec = {"name": "a", "description": "b", "level": "sil", "kind": "closed-loop", "timeout": "1 s"}
    written = {key: json.dumps(value) for key, value in spec.items()}
    folder = tmp_path / "tests" / "a"
    if place in written:
        written[place] = text
    (tmp_path / "dodo.yml").write_text(
        f"dodo: 1\nregistry: [tests]\n{f'rigs: {{{text}: 3}}' if place == 'rig' else ''}\n"
    )
    folder.mkdir(parents=True)
    body = "".join(f"{key}: {value}\n" for key, value in written.items())
    uses = text if place == "service" else "collision"
    (folder / "a.dodo.yml").write_text(f"dodo: 1\n{body}evaluation: {{{text}: {{uses: {uses}}}}}\n")
    if place == "file":
        (folder / f"{ATTACKS[attack].replace('/', '')}.dodo.yml").write_text("dodo: 1\n")
    for words in (("list",), ("compile", "--check"), ("explain", "a"), ("rig", "status")):
        _, output = dodo(*words)
        assert "internal error" not in output, output
        assert not FORBIDDEN.search(output), repr(output)


@pytest.mark.parametrize("attack", ATTACKS)
def test_a_results_file_commands_no_terminal(tmp_path: Path, attack: str) -> None:
    (tmp_path / "results.json").write_text(json.dumps({"dodo": "results", "version": 1, "tests": [ATTACKS[attack]]}))
    code, output = dodo("report", str(tmp_path))
    assert code == 2
    assert not FORBIDDEN.search(output), repr(output)


# Surroundings


def run(
    *words: str | bytes, shell: str = "", folder: Path | None = None, **variables: str | None
) -> "subprocess.CompletedProcess[str]":
    environment = {**os.environ, "PYTHONPATH": str(ROOT), **variables}
    command = [sys.executable, "-m", "dodo_dsl", *words]
    if shell:
        command = ["sh", "-c", f'exec "$@" {shell}', "sh", *command]
    return subprocess.run(
        command, cwd=folder or ROOT, env={k: v for k, v in environment.items() if v is not None},
        capture_output=True, text=True, errors="surrogateescape", timeout=60, check=False,
    )  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize(
    ("shell", "code", "said"),
    [
        (">&-", 3, "dodo: standard output is closed, redirect it to /dev/null instead\n"),
        (">&- 2>&-", 3, ""),
        ("2>&-", 3, ""),
        (">/dev/full", 3, "No space left on device\n"),
        ("<&-", 0, ""),
    ],
)
def test_streams_that_are_closed_or_full(shell: str, code: int, said: str) -> None:
    result = run("list", shell=shell)
    assert (result.returncode, result.stderr.endswith(said)) == (code, True), result.stderr
    assert "Traceback" not in result.stderr and "Exception ignored" not in result.stderr


@pytest.mark.slow
@pytest.mark.parametrize("words", [("doctor",), ("rig", "status")])
def test_a_user_without_a_home(words: tuple[str, ...]) -> None:
    result = run(*words, HOME=None, XDG_STATE_HOME=None, DODO_HISTORY=None, DODO_RIGS=None)
    assert result.returncode in (0, 1, 3)
    assert "Traceback" not in result.stderr and "internal error" not in result.stderr


def test_paths_that_are_not_utf_8(tmp_path: Path, record: Callable[..., Path], monkeypatch: pytest.MonkeyPatch) -> None:
    folder = Path(os.fsdecode(os.fsencode(tmp_path) + b"/\xff\xfe"))
    folder.mkdir()
    monkeypatch.chdir(folder)
    drive = record(video(1)).rename(folder / "drive.rec")
    (folder / "dodo.yml").write_text(f"dodo: 1\napplication: {ROOT}/examples/kiwi/docker-compose.yml\n")
    commands = (
        ("rec", "info", drive), ("rec", "info", drive, "--json"), ("rec", "cut", drive, "-o", folder / "new.rec"),
        ("rec", "export", drive, "--csv"), ("rec", "export", drive, "--coco", "--all", "-o", folder / "coco"),
        ("judge", drive, "--spec", "sil-closed-straight"), ("list", "--json"), ("compile", "--check", folder),
        ("compile", "sil-closed-straight", "-o", folder / "generated"), ("new", "sil-mine"), ("report", folder),
        ("compile", "--check", folder / "none"), ("explain", str(folder / "none")),
    )  # fmt: skip
    for words in commands:
        code, output = dodo(*map(str, words))
        assert code in (0, 1, 2, 3), words
        assert "Traceback" not in output and "internal error" not in output, (words, output)
        output.encode()  # a terminal takes it


@pytest.mark.slow
def test_a_path_that_is_not_utf_8_is_an_argument(tmp_path: Path) -> None:
    result = run("rec", "info", os.fsencode(tmp_path) + b"/\xff.rec")
    assert (result.returncode, "No such file" in result.stderr) == (2, True)
