"""What an application may read, and what of its own folder it does not see."""

import itertools
from pathlib import Path

import pytest

from dodo_dsl.run.process import confinement as module
from dodo_dsl.run.process import seccomp_filter
from dodo_dsl.run.process.confinement import Confinement, sandbox_words
from dodo_dsl.run.process.places import Places


class Made(Places):
    """Places that nobody has made."""

    def __init__(self, place: str = "/tmp", mounted: tuple[str, ...] = ()) -> None:
        self.folder, self.writable, self.home = Path("/tmp/x/folder"), True, Path("/tmp/x/home")
        self.shared, self.mounted, self.user = {place: Path("/tmp/x/tmp")}, mounted, None


MOUNTS = Made()


def test_what_is_hidden_is_hidden_by_each_name_of_its_folder(tmp_path: Path) -> None:
    (tmp_path / "models" / "tests").mkdir(parents=True)
    (tmp_path / "link").symlink_to("models")
    shown = (str(tmp_path / "link"), str(tmp_path / "models"))
    found = module._inside([str(tmp_path / "models" / "tests")], shown)
    assert list(found) == [f"{path}/tests" for path in shown]


def test_what_gives_it_the_time_can_be_written_to_and_not_replaced() -> None:
    """Also where its user is DoDo's: the agent's FIFOs to the clock are not there."""
    argv = sandbox_words(Confinement("/app", time="/dev/shm/t"), MOUNTS, "/usr/bin/true", {})
    at = argv.index("/dev/shm/t")
    assert argv[at - 1 : at + 5] == ["--ro-bind", "/dev/shm/t", "/dev/shm/t", "--bind", *["/dev/shm/t/page"] * 2]
    assert argv[at + 5 : at + 11] == [
        *("--ro-bind", "/dev/null", "/dev/shm/t/command"),
        *("--ro-bind", "/dev/null", "/dev/shm/t/reply"),
    ]


def test_nothing_is_mounted_in_what_is_hidden_but_what_may_be_read(tmp_path: Path) -> None:
    """The report is in the folder of the tests, and so is the interpreter."""
    tests, report, python = tmp_path / "tests", tmp_path / "tests" / "dodo-report", tmp_path / "tests" / "deep" / "venv"
    for folder in (report, python):
        folder.mkdir(parents=True)
    hidden = (str(report), str(tests), str(tests))
    argv = sandbox_words(Confinement(str(tmp_path), (str(python),), hidden), MOUNTS, "/usr/bin/x", {})
    assert [path for word, path in itertools.pairwise(argv) if word == "--tmpfs"] == [str(tests)]
    inside = argv[argv.index(str(tests)) + 1 :]
    assert inside[:3] == ["--ro-bind-try", str(python), str(python)]
    assert str(tests) in argv[len(argv) - argv[::-1].index("--remount-ro") - 6 :]


def test_what_may_be_read_in_the_folder_of_others_is_shown_and_nothing_else_there(tmp_path: Path) -> None:
    """Of ``/tmp`` the application has another one, where its own and other folders are mounted."""
    repository, venv, other = (tmp_path / name for name in ("repository", "venv", "other"))
    for folder in (repository / "app", venv, other):
        folder.mkdir(parents=True)
    mounts = Made(str(tmp_path), tuple(map(str, (repository, venv, other))))
    words = sandbox_words(Confinement(f"{repository}/app", (str(venv),)), mounts, "/bin/x", {})
    places = [tmp_path, other, repository, repository / "app", venv]
    before = [words[words.index(str(path)) - (1 if path in (other, repository) else 2)] for path in places[:3]]
    assert before == ["--bind", "--tmpfs", "--tmpfs"]
    assert [words.index(str(path)) for path in places] == sorted(words.index(str(path)) for path in places)
    assert words[words.index(str(venv)) - 1] == "--ro-bind-try"


@pytest.fixture(autouse=True)
def afresh() -> None:
    seccomp_filter.program.cache_clear()


def test_a_call_that_cannot_be_filtered_is_an_error_and_not_allowed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(seccomp_filter, "_REFUSED", ("mount", "call_of_the_future"))
    with pytest.raises(OSError, match="does not know the system call call_of_the_future"):
        seccomp_filter.program()
