"""One search by two workers on one storage, of which one is killed."""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from tests.search.scripted_drives import SPEC, repository

pytestmark = pytest.mark.slow

_WORKER = """
import os, sys, time
from pathlib import Path
import pytest
from dodo_dsl.cli.main import main
from tests.run.scripted import ScriptedBackend
from tests.search.scripted_drives import stages, stub

def backend(plan, attempt):
    path = Path(sys.argv[1] + ".txt")
    with path.open("a") as driven:
        driven.write(plan.slug + "\\n")
    if sys.argv[2] and len(path.read_text().split()) == 4:
        while not Path(sys.argv[2] + ".txt").exists():
            time.sleep(0.02)
        os.kill(os.getpid(), 9)
    return ScriptedBackend(plan, stages(plan))

stub(pytest.MonkeyPatch(), backend)
words = ["search", "example", "--isolation", "host", "--runs", "16", "-j", "1", "--report", sys.argv[1], *sys.argv[3:]]
sys.exit(main(words, sys.stdout, sys.stderr))
"""


def worker(name: str, ends_beside: str, *words: str) -> "subprocess.Popen[bytes]":
    path = {"PYTHONPATH": os.pathsep.join(sys.path)}
    return subprocess.Popen([sys.executable, "-c", _WORKER, name, ends_beside, *words], env={**os.environ, **path})


def result(name: str) -> dict[str, Any]:
    return dict(json.loads(Path(name, "search", "example", "search.json").read_text()))


def driven(name: str) -> list[str]:
    return Path(f"{name}.txt").read_text().split()


@pytest.mark.parametrize("place", ["shared/search.journal", "sqlite:///drives.db"])
def test_a_search_of_two_workers_loses_nothing_when_one_is_killed(tmp_path: Path, place: str) -> None:
    with repository(tmp_path, SPEC):
        assert worker("alone", "").wait(120) == 1
        first = worker("first", "second", "--storage", place)
        second = worker("second", "", "--storage", place)
        assert (first.wait(120), second.wait(120)) == (-signal.SIGKILL, 1)
        assert result("second") == result("alone")
        both = [*driven("first"), *driven("second")]
        assert set(both) == set(driven("alone"))
        assert worker("third", "", "--storage", place).wait(120) == 1
        assert result("third") == result("alone") and not Path("third.txt").exists()
