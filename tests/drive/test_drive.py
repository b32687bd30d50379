"""Whole tests: the registry with the example application, a silent one, and one on libcluon itself."""

import os
import re
from pathlib import Path

import pytest

from tests.drive.applications import dodo, results

pytestmark = pytest.mark.realtime

BOTH = ("sil-closed-straight", "sil-closed-left-curve")


def good_drives(report: Path) -> None:
    """Both tests passed, and their reports hold what they should."""
    tests = results(report)
    assert set(tests) == {*BOTH}
    for slug, test in tests.items():
        assert test["outcome"] == "passed", test
        checks = {c["name"]: c for c in test["checks"]}
        assert 3.0 < checks["time-to-goal"]["value"] < 40.0
        assert checks["wall-margin"]["value"] > 0.03 and checks["wall-margin"]["exclusive"]
        assert (report / slug / "trajectory.png").read_bytes().startswith(b"\x89PNG")
        assert (report / slug / "test.rec").stat().st_size > 10_000


def test_they_pass_at_once_in_real_time(tmp_path: Path) -> None:
    dodo("run", *BOTH, "--clock", "realtime", "-j", "2", "--report", str(tmp_path), code=0)
    good_drives(tmp_path)


def test_they_pass_at_once_on_the_host_and_leave_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Shared memory and semaphores of the host, which this run has for itself, and token files are gone at the end."""
    monkeypatch.setenv("DODO_LEASES", str(tmp_path / "leases"))
    words = [*BOTH, "--isolation", "host", "-j", "2", "--report", str(tmp_path / "report")]
    own = ["unshare", "--ipc", *(() if os.getuid() == 0 else ("--user", "--map-root-user"))]
    left = ["sh", "-c", '"$@" && cat /proc/sysvipc/shm /proc/sysvipc/sem', "sh"]
    output = dodo("run", *words, code=0, before=[*own, *left])
    good_drives(tmp_path / "report")
    memory, semaphores = output.splitlines()[-2:]
    assert memory.split()[:2] == ["key", "shmid"], output
    assert semaphores.split()[:2] == ["key", "semid"], output
    logs = "".join(p.read_text() for p in (tmp_path / "report").glob("*/logs/application.perception.log"))
    names = set(re.findall(r"dodo-\w+-video0\.argb", logs))
    assert len(names) == 2, logs
    assert [name for name in names if Path("/tmp", name).exists()] == []
    assert (tmp_path / "leases").is_dir() and not list((tmp_path / "leases").iterdir())
    assert not list((tmp_path / "leases").glob("*.json"))
