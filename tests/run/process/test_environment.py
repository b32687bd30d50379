"""What processes get of DoDo's own environment."""

import os
import sys
from pathlib import Path

import pytest

from dodo_dsl.run.process.environment import application_environment, base_environment, own_environment

OUTSIDE = {
    "PATH": "/usr/bin",
    "HOME": "/home/team",
    "LC_TIME": "C",
    "PYTHONPATH": "/lib",
    "VIRTUAL_ENV": "/venv",
    "TMPDIR": "/var/tmp",
    "LD_PRELOAD": "x.so",
    "SSH_AUTH_SOCK": "/run/agent",
    "DISPLAY": ":0",
    "CI_JOB_TOKEN": "t0ken",
    "LICENSE_KEY": "k3y",
}


@pytest.fixture(autouse=True)
def outside(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "environ", dict(OUTSIDE))


def test_an_application_gets_what_it_needs_to_run_and_what_is_passed() -> None:
    got = application_environment()
    assert set(got) == {"PATH", "HOME", "LC_TIME", "PYTHONPATH", "VIRTUAL_ENV", "PYTHONUNBUFFERED"}
    assert got["PATH"] == f"{Path(sys.executable).parent}:/usr/bin"
    passed = application_environment(("DISPLAY", "LICENSE_KEY", "NOT_SET"))
    assert passed == {**got, "DISPLAY": ":0", "LICENSE_KEY": "k3y"}


def test_own_services_get_all_but_secrets() -> None:
    assert set(OUTSIDE) - set(own_environment()) == {"CI_JOB_TOKEN", "LICENSE_KEY"}
    assert set(OUTSIDE) - set(base_environment(("LICENSE_KEY",))) == {"CI_JOB_TOKEN"}
