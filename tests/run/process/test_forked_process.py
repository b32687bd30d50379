"""A forked module is as one that was started, of a server that leaves no trace in it."""

import os
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

from dodo_dsl.run.process.children import ForkedModule

TELLS = """
import os, signal, sys
print(__name__, sys.argv[1:], os.getcwd(), sorted(os.environ), sys.stdin.read() == "", flush=True)
print(os.getsid(0) == os.getpid(), [n for n in map(int, os.listdir("/proc/self/fd")) if n > 2][:-1], flush=True)
print(signal.getsignal(signal.SIGTERM) is signal.SIG_DFL, signal.getsignal(signal.SIGCHLD) is signal.SIG_DFL)
print("an error", file=sys.stderr)
"""


PARENT = """
import signal, sys
from dodo_dsl.run.process.children import ForkedModule
signal.signal(signal.SIGTERM, lambda *_: None)
sys.path.insert(0, sys.argv[1])
with open(sys.argv[1] + "/log", "wb") as log:
    child = ForkedModule(["python", "-m", sys.argv[2], "--a=b", "c"], {"ONLY": "1"}, sys.argv[1], log.fileno())
print(child.wait())
"""


def run(folder: Path, code: str | None) -> tuple[int, str]:
    """Exit code and output of a module with this code, or of one that is not there."""
    if code is not None:
        (folder / "program.py").write_text(textwrap.dedent(code))
    words = [sys.executable, "-c", PARENT, str(folder), "program"]
    result = subprocess.run(words, capture_output=True, text=True, check=True)
    return int(result.stdout), (folder / "log").read_text()


def test_it_finds_what_a_started_program_finds(tmp_path: Path) -> None:
    code, output = run(tmp_path, TELLS)
    assert code == 0, output
    assert output.splitlines() == [
        f"__main__ ['--a=b', 'c'] {tmp_path} ['ONLY'] True",
        "True []",
        "True True",
        "an error",
    ]


@pytest.mark.parametrize(
    ("code", "expected", "told"),
    [
        ("pass", 0, ""),
        ("import sys; sys.exit(3)", 3, ""),
        ("import sys; sys.exit('too bad')", 1, "too bad"),
        ("raise ValueError('odd')", 1, "ValueError: odd"),
        ("raise KeyboardInterrupt", 1, "KeyboardInterrupt"),
        ("import os; os.kill(os.getpid(), 9)", -9, ""),
        ("import os; os.kill(os.getpid(), 15)", -15, ""),
    ],
)
def test_it_ends_as_a_started_program_ends(tmp_path: Path, code: str, expected: int, told: str) -> None:
    ended, output = run(tmp_path, code)
    assert ended == expected
    assert (output.splitlines() or [""])[-1] == told


def test_a_module_that_is_not_there(tmp_path: Path) -> None:
    code, output = run(tmp_path, None)
    assert code == 1
    assert output.splitlines()[-1] == "ImportError: No module named program"


def test_a_folder_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(OSError, match="gone"):
        ForkedModule(["python", "-m", "this"], {}, str(tmp_path / "gone"), 1)


LOAD = """
import os, sys
from dodo_dsl.run.process import fork_server
before = dict(os.environ)
fork_server.load()
fork_server.load_services(["services.virtual_camera", "services.not_there"])
assert {"numpy", "services.virtual_camera.service"} <= sys.modules.keys()
assert "scipy" not in sys.modules
assert "services.virtual_camera.__main__" not in sys.modules
print(len(os.listdir("/proc/self/task")), before == os.environ)
"""


@pytest.mark.slow
@pytest.mark.parametrize("threads", [None, "3"])
def test_it_has_one_thread_and_the_variables_of_before(threads: str | None) -> None:
    """The kernel lets no process with several threads into a user namespace, and applications inherit the variables."""
    environment = {name: value for name, value in os.environ.items() if name != "OPENBLAS_NUM_THREADS"}
    environment.update({} if threads is None else {"OPENBLAS_NUM_THREADS": threads})
    words = [sys.executable, "-c", LOAD]
    result = subprocess.run(words, env=environment, capture_output=True, text=True, check=True)
    assert result.stdout == "1 True\n"
