"""Whole tests: the registry with the example application, a wrong application, and one on libcluon itself."""

import json
import shutil
import time
from pathlib import Path

import pytest
import yaml

from dodo_dsl.run.process.host_isolation import namespaces_refusal
from tests.drive.applications import ROOT, dodo, kiwi, results


@pytest.fixture(params=["network", "host"])
def isolation(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> str:
    monkeypatch.setenv("DODO_LEASES", str(tmp_path / "leases"))
    why = namespaces_refusal() if request.param == "network" else ""
    if why:
        pytest.skip(f"no namespaces here: {why}")
    return str(request.param)


def test_they_pass_at_once(isolation: str, tmp_path: Path) -> None:
    report = tmp_path / "report"
    names = ["sil-closed-straight", "sil-closed-left-curve"]
    dodo("run", *names, "--isolation", isolation, "-j", "2", "--report", str(report), code=0)
    for slug, test in results(report).items():
        assert test["outcome"] == "passed", test
        checks = {c["name"]: c for c in test["checks"]}
        assert 3.0 < checks["time-to-goal"]["value"] < 40.0
        assert checks["wall-margin"]["value"] > 0.03
        assert (report / slug / "trajectory.png").read_bytes().startswith(b"\x89PNG")
        assert (report / slug / "test.rec").stat().st_size > 10_000


def test_reversed_steering_hits_a_wall(tmp_path: Path) -> None:
    application = kiwi(tmp_path / "app", steering="--reverse")
    report = tmp_path / "report"
    words = ["run", "sil-closed-straight", "--application", str(application), "--report", str(report)]
    out = dodo(*words, code=1)
    test = results(report)["sil-closed-straight"]
    assert test["outcome"] == "failed"
    assert str(test["reason"]).startswith("hit wall ")
    assert " s at x = " in str(test["reason"])
    assert str(test["reason"]) in out


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
    (tmp_path / "silent.py").write_text("import time\ntime.sleep(60)\n")
    report = tmp_path / "report"
    dodo("run", str(spec), "--application", str(application), "--report", str(report), code=1)
    test = results(report)["sil-short"]
    assert test["outcome"] == "failed"
    assert "sent no GroundSteeringRequest" in str(test["reason"])


@pytest.mark.parametrize(("steering", "reason"), [("0.12", "hit wall left "), ("-0.12", "hit wall right ")])
def test_libcluon_sees_the_camera_and_steers_the_car(steering: str, reason: str, tmp_path: Path) -> None:
    pytest.importorskip("pycluon")
    shutil.copy(Path(__file__).parent / "cluon_app.py", tmp_path)
    application = tmp_path / "docker-compose.yml"
    service = {
        "image": "x",
        "command": f"--cid=111 --name=video0.argb --steering={steering}",
        "x-dodo-process": ["python", "cluon_app.py"],
    }
    application.write_text(yaml.safe_dump({"services": {"cluon": service}}))
    report = tmp_path / "report"
    began = time.time()
    words = ["run", "sil-closed-left-curve", "--clock", "realtime", "--application", str(application)]
    dodo(*words, "--report", str(report), code=1)
    test = results(report)["sil-closed-left-curve"]
    assert str(test["reason"]).startswith(reason)
    log = (report / "sil-closed-left-curve" / "logs" / "application.cluon.log").read_text()
    seen = [json.loads(line) for line in log.splitlines() if line.startswith("{")]
    assert len(seen) > 5
    assert all(s["valid"] and s["bytes"] == 640 * 480 * 4 and s["colours"] > 10 for s in seen)
    stamps = [s["stamp"] for s in seen]
    assert stamps == sorted(set(stamps))
    assert began < stamps[0] < stamps[-1] < time.time()
    assert seen[-1]["frames"] - seen[0]["frames"] > 5 * (len(seen) - 1)
    assert (seen[-1]["at"][0] < -0.02) == (float(steering) > 0)


def test_nothing_is_left_behind(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Shared memory, semaphores and token files of the host are as before."""
    monkeypatch.setenv("DODO_LEASES", str(tmp_path / "leases"))

    def traces() -> tuple[list[str], list[str], set[str]]:
        memory, semaphores = (Path(f"/proc/sysvipc/{kind}").read_text().splitlines() for kind in ("shm", "sem"))
        tokens = {p.name for p in Path("/tmp").glob("*video0*")}
        return [m.split()[0] for m in memory], [s.split()[0] for s in semaphores], tokens

    before = traces()
    dodo("run", "sil-closed-straight", "--isolation", "host", "--report", str(tmp_path / "report"), code=0)
    assert traces() == before
    assert list((tmp_path / "leases").glob("*.lock"))
    assert not list((tmp_path / "leases").glob("*.json"))
