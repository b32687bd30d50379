"""The fork server loads what services need without a trace in what it forks."""

import os
import subprocess
import sys

import pytest

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
