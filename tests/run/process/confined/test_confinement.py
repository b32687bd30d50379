"""What an application may read, and what of its own folder it does not see."""

import itertools
import json
import sys
from dataclasses import asdict
from pathlib import Path

import msgspec

from dodo_dsl.run.process import confinement as module
from dodo_dsl.run.process.confinement import Confinement, Mounts, confinement, sandbox_words
from dodo_dsl.spec.sandbox_limits import SandboxLimits

MOUNTS = Mounts(Path("/tmp/x/folder"), True, Path("/tmp/x/home"), {"/tmp": Path("/tmp/x/tmp")})


def test_paths_are_relative_to_its_folder_and_the_interpreter_is_there(tmp_path: Path) -> None:
    limits = SandboxLimits(reads=("../models", "/srv/ros"))
    reads = confinement(tmp_path / "app", "network", 130, limits, ()).reads
    assert {sys.prefix, sys.base_prefix, str(tmp_path / "models"), "/srv/ros"} <= set(reads)


def test_what_is_hidden_lies_in_its_folder(tmp_path: Path) -> None:
    hidden = (tmp_path / "tests", tmp_path / ".git", tmp_path, tmp_path.parent / "elsewhere")
    found = confinement(tmp_path, "network", 130, SandboxLimits(), hidden)
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
        Confinement(folder, "network", 1, (python,), ("/usr/share", inner, tests, "/usr/share/perl5")),
        MOUNTS,
        "/usr/bin/x",
        None,
        5,
    )
    order = [argv.index(word) for word in ("/usr/share", python, folder, inner, tests)]
    assert argv[order[0] - 1] == "--tmpfs"
    assert max(order[1:3]) < argv.index(inner)
    assert "/usr/share/perl5" not in argv


def test_it_goes_to_the_sandbox_and_back() -> None:
    one = Confinement(
        "/app", "network", 130, ("/usr/x",), ("/app/tests",), SandboxLimits(memory=5, reads=("a",)), ("/dev/x",)
    )
    assert msgspec.convert(json.loads(json.dumps(asdict(one))), Confinement) == one


def test_a_program_elsewhere_is_shown_and_its_folder_is_not() -> None:
    argv = sandbox_words(Confinement("/app", "network", 130), MOUNTS, "/srv/bin/drive", None, 5)
    bound = [argv[n + 1] for n, word in enumerate(argv) if word == "--ro-bind-try"]
    assert "/srv/bin/drive" in bound
    assert not {"/srv", "/srv/bin", "/", "/home", "/var"} & set(bound)


def test_what_gives_it_the_time_can_be_written_to_and_not_replaced() -> None:
    """Also where its user is DoDo's: the agent's FIFOs to the clock are not there."""
    argv = sandbox_words(Confinement("/app", "network", 130, time="/dev/shm/t"), MOUNTS, "/usr/bin/true", None, 5)
    at = argv.index("/dev/shm/t")
    assert argv[at - 1 : at + 5] == ["--ro-bind", "/dev/shm/t", "/dev/shm/t", "--bind", *["/dev/shm/t/page"] * 2]
    assert argv[at + 5 : at + 11] == [
        *("--ro-bind", "/dev/null", "/dev/shm/t/command"),
        *("--ro-bind", "/dev/null", "/dev/shm/t/reply"),
    ]


def test_as_root_another_user_starts_it() -> None:
    argv = sandbox_words(Confinement("/app", "network", 130), MOUNTS, "/usr/bin/true", 64_130, 5)
    assert argv[argv.index("setpriv") + 1 :][:2] == ["--reuid=64130", "--regid=64130"]
    assert argv.index("setpriv") > argv.index("ALL")


def test_on_the_host_it_sees_what_dodo_sees_in_a_process_namespace() -> None:
    argv = sandbox_words(Confinement("/app", "host", 130), None, "/usr/bin/true", None, 5)
    assert "--unshare-pid" in argv
    assert argv[argv.index("--dev-bind") :][:3] == ["--dev-bind", "/", "/"]


def test_nothing_is_mounted_in_what_is_hidden_but_what_may_be_read(tmp_path: Path) -> None:
    """The report is in the folder of the tests, and so is the interpreter."""
    tests, report, python = tmp_path / "tests", tmp_path / "tests" / "dodo-report", tmp_path / "tests" / "deep" / "venv"
    for folder in (report, python):
        folder.mkdir(parents=True)
    hidden = (str(report), str(tests), str(tests))
    argv = sandbox_words(
        Confinement(str(tmp_path), "network", 1, (str(python),), hidden), MOUNTS, "/usr/bin/x", None, 5
    )
    assert [path for word, path in itertools.pairwise(argv) if word == "--tmpfs"] == [str(tests)]
    inside = argv[argv.index("--bind", argv.index(str(MOUNTS.folder))) :]
    inside = inside[inside.index(str(tests)) + 1 :]
    assert inside[: inside.index("--remount-ro")] == [
        *("--perms", "0755", "--dir", str(python.parent)),
        *("--ro-bind-try", str(python), str(python)),
    ]
