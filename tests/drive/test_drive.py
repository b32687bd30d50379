"""Whole tests: the registry with the example application, a silent one, and one on libcluon itself."""

import json
import os
import re
import shutil
import time
from pathlib import Path

import pytest
import yaml

from tests.drive.applications import ROOT, TOLD, dodo, results
from tests.drive.variants import registry, variant

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
    assert list((tmp_path / "leases").glob("*.lock"))
    assert not list((tmp_path / "leases").glob("*.json"))


def test_silent_application_fails(tmp_path: Path) -> None:
    """A blind application that sends nothing: the verdict says so when the time is over."""
    spec = tmp_path / "tests" / "sil-short" / "sil-short.dodo.yml"
    spec.parent.mkdir(parents=True)
    shutil.copytree(ROOT / "tests_registry" / "maps", tmp_path / "tests" / "maps")
    text = (ROOT / "tests_registry" / "sil-closed-straight" / "sil-closed-straight.dodo.yml").read_text()
    spec.write_text(text.replace("sil-closed-straight", "sil-short").replace("max-time: 40 s", "max-time: 1 s"))
    application = tmp_path / "docker-compose.yml"
    service = {"image": "x", "command": "--cid=111 --name=video0.argb", "x-dodo-process": ["python", "silent.py"]}
    application.write_text(yaml.safe_dump({"services": {"silent": service}}))
    (tmp_path / "silent.py").write_text("import time\ntime.sleep(600)\n")
    report = tmp_path / "report"
    words = ["run", str(spec), "--clock", "realtime", "--application", str(application)]
    dodo(*words, "--report", str(report), code=1)
    test = results(report)["sil-short"]
    assert test["outcome"] == "failed"
    assert "sent no GroundSteeringRequest" in str(test["reason"])


def test_libcluon_sees_the_camera_and_steers_the_car(tmp_path: Path) -> None:
    """In real time, for which the run asks in place of the spec; it steers to the right, in lockstep to the left."""
    pytest.importorskip("pycluon")
    shutil.copy(Path(__file__).parent / "cluon_app.py", tmp_path)
    application = tmp_path / "docker-compose.yml"
    service = {
        "image": "x",
        "command": "--cid=111 --name=video0.argb --steering=-0.12",
        "x-dodo": TOLD,
        "x-dodo-process": ["python", "cluon_app.py"],
    }
    spec = variant(registry(tmp_path), "sil-closed-left-curve", "told", pose="declared")
    application.write_text(yaml.safe_dump({"services": {"cluon": service}}))
    report = tmp_path / "report"
    began = time.time()
    words = ["run", str(spec), "--clock", "realtime", "--application", str(application)]
    dodo(*words, "--report", str(report), code=1)
    test = results(report)["told"]
    assert (test["clock"], test["sim_s"]) == ("realtime", None)
    hit = re.match(r"hit wall right after (\d+\.\d\d) s ", str(test["reason"]))
    assert hit, test["reason"]
    assert test["execution_s"] > float(hit[1]) - 0.005, "from the begin, when the application listens, to the verdict"
    assert "the application gets its true pose" in test["reason"]
    log = (report / "told" / "logs" / "application.cluon.log").read_text()
    seen = [json.loads(line) for line in log.splitlines() if line.startswith("{")]
    if not seen[-1]["valid"]:
        seen.pop()  # read while the test ended, and the camera's memory with it
    assert len(seen) > 5
    assert all(s["valid"] and s["bytes"] == 640 * 480 * 4 and s["colours"] > 10 for s in seen)
    stamps = [s["stamp"] for s in seen]
    assert stamps == sorted(set(stamps))
    assert began < stamps[0] < stamps[-1] < time.time()
    assert seen[-1]["frames"] - seen[0]["frames"] > 5 * (len(seen) - 1)
    assert seen[-1]["at"][0] > -0.02
