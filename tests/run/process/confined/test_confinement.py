"""What an application may read, and what of its own folder it does not see."""

import itertools
import sys
from pathlib import Path

import pytest

from dodo_dsl.run.process import confinement as module
from dodo_dsl.run.process import seccomp_filter
from dodo_dsl.run.process.confinement import Confinement, as_data, confinement, sandbox_words
from dodo_dsl.run.process.places import Places
from dodo_dsl.spec.sandbox_limits import SandboxLimits


class Made(Places):
    """Places that nobody has made."""

    def __init__(self, place: str = "/tmp", mounted: tuple[str, ...] = ()) -> None:
        self.folder, self.writable, self.home = Path("/tmp/x/folder"), True, Path("/tmp/x/home")
        self.shared, self.mounted, self.user = {place: Path("/tmp/x/tmp")}, mounted, None


MOUNTS = Made()


def test_paths_are_relative_to_its_folder_and_the_interpreter_is_there(tmp_path: Path) -> None:
    limits = SandboxLimits(reads=("../models", "/srv/ros"))
    reads = confinement(tmp_path / "app", limits, ()).reads
    assert {sys.prefix, sys.base_prefix, str(tmp_path / "models"), "/srv/ros"} <= set(reads)


def test_what_is_hidden_lies_in_its_folder(tmp_path: Path) -> None:
    hidden = (tmp_path / "tests", tmp_path / ".git", tmp_path, tmp_path.parent / "elsewhere")
    found = confinement(tmp_path, SandboxLimits(), hidden)
    assert found.hidden[:2] == (str(tmp_path / "tests"), str(tmp_path / ".git"))
    assert not {str(tmp_path), str(tmp_path.parent / "elsewhere")} & set(found.hidden)


def test_what_is_hidden_is_hidden_by_each_name_of_its_folder(tmp_path: Path) -> None:
    (tmp_path / "models" / "tests").mkdir(parents=True)
    (tmp_path / "link").symlink_to("models")
    shown = (str(tmp_path / "link"), str(tmp_path / "models"))
    found = module._inside([tmp_path / "models" / "tests"], shown)
    assert list(found) == [f"{path}/tests" for path in shown]


def test_a_repository_where_every_application_sees_the_machine_is_hidden_around_its_folder() -> None:
    """But not what may be read there, in which there may be tests again."""
    folder, python = "/usr/share/doc", "/usr/share/common-licenses"
    inner, tests = f"{python}/{next(Path(python).iterdir()).name}", f"{folder}/bash"
    argv = sandbox_words(
        Confinement(folder, (python,), ("/usr/share", inner, tests, "/usr/share/perl5")),
        MOUNTS,
        "/usr/bin/x",
        {},
    )
    order = [argv.index(word) for word in ("/usr/share", python, folder, inner, tests)]
    assert argv[order[0] - 1] == "--tmpfs"
    assert order[0] < min(order[1:3]) and order[1] < order[3] and order[2] < order[4]
    assert "/usr/share/perl5" not in argv


def test_a_program_elsewhere_is_shown_and_its_folder_is_not() -> None:
    argv = sandbox_words(Confinement("/app"), MOUNTS, "/srv/bin/drive", {})
    bound = [argv[n + 1] for n, word in enumerate(argv) if word == "--ro-bind-try"]
    assert "/srv/bin/drive" in bound
    assert not {"/srv", "/srv/bin", "/", "/home", "/var"} & set(bound)


def test_what_gives_it_the_time_can_be_written_to_and_not_replaced() -> None:
    """Also where its user is DoDo's: the agent's FIFOs to the clock are not there."""
    argv = sandbox_words(Confinement("/app", time="/dev/shm/t"), MOUNTS, "/usr/bin/true", {})
    at = argv.index("/dev/shm/t")
    assert argv[at - 1 : at + 5] == ["--ro-bind", "/dev/shm/t", "/dev/shm/t", "--bind", *["/dev/shm/t/page"] * 2]
    assert argv[at + 5 : at + 11] == [
        *("--ro-bind", "/dev/null", "/dev/shm/t/command"),
        *("--ro-bind", "/dev/null", "/dev/shm/t/reply"),
    ]


def test_no_variable_is_a_word_of_its_own() -> None:
    argv = sandbox_words(Confinement("/app"), None, "/usr/bin/true", {"A": "--bind"})
    assert argv[argv.index("--clearenv") :][:4] == ["--clearenv", "--setenv", "A", "--bind"]
    with pytest.raises(ValueError, match="NUL"):
        as_data(["--setenv", "A", "b\0--bind"])


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


def test_it_is_a_program_for_the_kernel() -> None:
    assert len(seccomp_filter.program()) % 8 == 0
    assert len(seccomp_filter.program()) > 8 * len(seccomp_filter._REFUSED)


def test_a_call_that_cannot_be_filtered_is_an_error_and_not_allowed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(seccomp_filter, "_REFUSED", ("mount", "call_of_the_future"))
    with pytest.raises(seccomp_filter.NoSeccomp, match="does not know the system call call_of_the_future"):
        seccomp_filter.program()
