"""The same tests in containers of a real engine: isolated from each other, and gone afterwards."""

import grp
import json
import os
import shutil
import signal
import socket
import stat
import subprocess
import sys
import time
from pathlib import Path

import pytest
import yaml

from dodo_dsl import __version__
from dodo_dsl.opendlv.bus.address import group

ROOT = Path(__file__).parents[2]
HOSTILE = Path(__file__).parent / "hostile"
DRIVES = ("sil-closed-straight", "sil-closed-left-curve")
HARMS = ("flood", "groups", "memory", "tmp")

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("images")]


def start(folder: Path, *words: str) -> "subprocess.Popen[str]":
    environment = {**os.environ, "DODO_LEASES": str(folder / "leases")}
    command = [sys.executable, "-m", "dodo_dsl", "run", "--backend", "docker", *words]
    return subprocess.Popen(
        command, cwd=ROOT, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    )


def results(report: Path) -> dict[str, dict[str, object]]:
    return {t["slug"]: t for t in json.loads((report / "results.json").read_text())["tests"]}


def of_dodo() -> dict[str, int]:
    """How many containers, networks and volumes of tests the engine holds."""

    def count(*words: str) -> int:
        out = subprocess.run(["docker", *words], capture_output=True, text=True, check=True).stdout
        return sum("dodo-" in line for line in out.splitlines())

    return {
        "containers": count("ps", "-a", "--format", "{{.Names}}"),
        "networks": count("network", "ls", "--format", "{{.Name}}"),
        "volumes": count("volume", "ls", "--format", "{{.Name}}"),
    }


@pytest.fixture(autouse=True)
def clean_engine() -> object:
    """Every test leaves the engine as it was."""
    before = of_dodo()
    yield
    assert of_dodo() == before


def test_both_pass_at_once_with_the_unedited_compose_file(tmp_path: Path) -> None:
    report = tmp_path / "report"
    out, _ = start(tmp_path, *DRIVES, "-j", "2", "--report", str(report)).communicate(timeout=240)
    tests = results(report)
    assert [t["outcome"] for t in tests.values()] == ["passed", "passed"], out
    for slug, test in tests.items():
        checks = {c["name"]: c for c in test["checks"]}  # type: ignore[attr-defined]
        assert set(checks) == {"time-to-goal", "wall-margin", "distance", "max-speed"}
        assert checks["wall-margin"]["value"] > 0.03
        assert (report / slug / "test.rec").stat().st_size > 10_000
        assert (report / slug / "trajectory.png").is_file()
        assert "frame 1:" in (report / slug / "logs" / "application.perception.log").read_text()


def test_the_emulated_rig_in_containers(tmp_path: Path) -> None:
    """A machine that is too busy for the emulated rig gets two more tries."""
    if not (ROOT / "build" / "firmware" / "rig-emulator").exists():
        pytest.skip("the emulated rig is not built: make firmware")
    report = tmp_path / "report"
    process = start(tmp_path, "hil-camera", "hil-dynamic", "--retry-errors", "2", "--report", str(report))
    out, _ = process.communicate(timeout=400)
    assert process.returncode == 0, out
    assert {test["outcome"] for test in results(report).values()} == {"passed"}
    assert (report / "hil-camera" / "snapshot.png").read_bytes().startswith(b"\x89PNG")


def test_a_rig_s_device_is_open_to_the_service(tmp_path: Path) -> None:
    """As a serial port is on Debian: for its group alone."""
    device = Path(f"/dev/dodo-test-{os.getpid()}")
    for name in ("tests_registry", "examples"):
        shutil.copytree(ROOT / name, tmp_path / name, ignore=shutil.ignore_patterns("__pycache__"))
    deployment = yaml.safe_load((ROOT / "dodo.yml").read_text())
    deployment["rigs"] = {
        "bench": {"kind": "dynamic", "cid": 120, "serial": str(device), "camera": {"source": "rpicam"}}
    }
    (tmp_path / "dodo.yml").write_text(yaml.safe_dump(deployment))
    spec = tmp_path / "tests_registry" / "hil-dynamic" / "hil-dynamic.dodo.yml"
    spec.write_text(spec.read_text().replace("rig: emulated", "rig: bench"))
    subprocess.run([sys.executable, "-m", "dodo_dsl", "compile", str(spec)], cwd=tmp_path, check=True)
    try:
        os.mknod(device, stat.S_IFCHR, os.makedev(1, 3))
    except PermissionError:
        pytest.skip("this user may not make device files")
    folder = tmp_path / "generated" / "hil-dynamic"
    command = ["docker", "compose", "run", "--rm", "--no-deps", "--entrypoint", "sh", "pose"]
    words = [*command, "-c", f"test -w {device} && id -u"]
    try:
        os.chown(device, 0, grp.getgrnam("dialout").gr_gid)
        device.chmod(0o660)
        result = subprocess.run(words, cwd=folder, capture_output=True, text=True, check=False)
    finally:
        device.unlink()
        subprocess.run(["docker", "compose", "down", "-v"], cwd=folder, capture_output=True, check=False)
    assert (result.stdout.strip(), result.returncode) == ("10001", 0), result.stderr


def hostile_test(folder: Path, harm: str) -> tuple[Path, Path]:
    """A spec that waits in vain for its application, and that application's compose file."""
    registry = folder / harm / "tests"
    name = f"sil-hostile-{harm}"
    spec = registry / name / f"{name}.dodo.yml"
    spec.parent.mkdir(parents=True)
    shutil.copytree(ROOT / "tests_registry" / "maps", registry / "maps")
    text = (ROOT / "tests_registry" / "sil-closed-straight" / "sil-closed-straight.dodo.yml").read_text()
    spec.write_text(text.replace("sil-closed-straight", name).replace("max-time: 40 s", "max-time: 20 s"))
    service = {
        "image": f"dodo/vision:{__version__}",
        "network_mode": "host",
        "ipc": "host",
        "volumes": ["/tmp:/tmp", f"{HOSTILE}:/app:ro"],
        "entrypoint": ["python3", "/app/hostile.py"],
        "command": f"--cid=111 --name=video0.argb --harm={harm}",
    }
    compose = folder / harm / "docker-compose.yml"
    compose.write_text(yaml.safe_dump({"services": {"hostile": service}}))
    return spec, compose


def test_hostile_neighbours_are_neither_heard_nor_felt(tmp_path: Path) -> None:
    """Six tests at once: two that drive, beside a flood, traffic on all groups, memory scribbling, a full /tmp."""
    hostile = []
    for harm in HARMS:
        spec, compose = hostile_test(tmp_path, harm)
        words = [str(spec), "--application", str(compose), "--report", str(tmp_path / harm / "report")]
        hostile.append(start(tmp_path, *words))
    good = start(tmp_path, *DRIVES, "-j", "2", "--report", str(tmp_path / "good"))
    out, _ = good.communicate(timeout=300)
    outs = [p.communicate(timeout=300)[0] for p in hostile]
    assert [t["outcome"] for t in results(tmp_path / "good").values()] == ["passed", "passed"], out
    for harm, said in zip(HARMS, outs, strict=True):
        (test,) = results(tmp_path / harm / "report").values()
        assert test["outcome"] == "failed", said  # as each of them alone
        assert "sent no GroundSteeringRequest" in str(test["reason"])
        log = next((tmp_path / harm / "report").glob("*/logs/application.hostile.log")).read_text()
        assert log.startswith(f"hostile: {harm}")


def test_reaping_touches_nothing_else(tmp_path: Path) -> None:
    """A stranger's container stays, though a killed run's goes."""
    base = f"dodo/sandbox:{__version__}"
    run = ["docker", "run", "-d", "--rm", "--label", "com.docker.compose.project=stranger", base, "sleep", "60"]
    stranger = subprocess.run(run, capture_output=True, text=True, check=True).stdout.strip()
    try:
        process = start(tmp_path, "sil-closed-straight", "--report", str(tmp_path / "report"))
        process.communicate(timeout=240)
        running = subprocess.run(
            ["docker", "ps", "-q", "--no-trunc"], capture_output=True, text=True, check=True
        ).stdout
        assert stranger in running.split()
    finally:
        subprocess.run(["docker", "rm", "-f", stranger], capture_output=True, check=True)


@pytest.mark.parametrize(
    ("command", "reason"),
    [
        (["sh", "-c", "exit 0"], "application service 'app' ended with exit code 0 after"),
        (["sh", "-c", "exit 7"], "application service 'app' ended with exit code 7 after"),
        (["no-such-program"], "service 'app' could not be started: "),
    ],
)
def test_applications_that_end(command: list[str], reason: str, tmp_path: Path) -> None:
    compose = tmp_path / "docker-compose.yml"
    service = {"image": f"dodo/base:{__version__}", "entrypoint": command, "environment": ["CID=111"]}
    compose.write_text(yaml.safe_dump({"services": {"app": service}}))
    words = ["sil-closed-straight", "--application", str(compose), "--report", str(tmp_path / "report")]
    out, _ = start(tmp_path, *words).communicate(timeout=120)
    (test,) = results(tmp_path / "report").values()
    assert str(test["reason"]).startswith(reason), out
    assert test["outcome"] == ("error" if "started" in reason else "failed")


def test_interrupt_takes_everything_down(tmp_path: Path) -> None:
    process = start(tmp_path, "sil-closed-straight", "--report", str(tmp_path / "report"))
    assert process.stdout is not None
    for line in process.stdout:
        if "waiting for action" in line:
            break
    process.send_signal(signal.SIGINT)
    out, _ = process.communicate(timeout=60)
    assert process.returncode == 130, out
    assert "Traceback" not in out


def test_kept_project_stays_until_it_is_taken_down(tmp_path: Path) -> None:
    process = start(tmp_path, "sil-closed-straight", "--keep", "--report", str(tmp_path / "report"))
    out, _ = process.communicate(timeout=240)
    assert process.returncode == 0, out
    (line,) = [text for text in out.splitlines() if text.startswith("take it down: ")]
    assert of_dodo()["containers"] > 5
    subprocess.run(line.removeprefix("take it down: ").split(), capture_output=True, check=True)
    deadline = time.monotonic() + 10
    while of_dodo()["containers"] and time.monotonic() < deadline:
        time.sleep(0.1)


def test_compiled_test_runs_by_hand(tmp_path: Path) -> None:
    """``cd DIR/<slug> && docker compose up``: the verdict stands in the log, whatever lies above."""
    out = tmp_path / "generated"
    (tmp_path / "docker-compose.yml").write_text("services: {stranger: {image: stranger}}\n")
    subprocess.run([sys.executable, "-m", "dodo_dsl", "compile", "-o", str(out)], cwd=ROOT, check=True)
    folder = out / "sil-closed-straight"
    up = ["docker", "compose", "up", "--exit-code-from", "track"]
    result = subprocess.run(up, cwd=folder, capture_output=True, text=True, check=False, timeout=240)
    subprocess.run(["docker", "compose", "down", "-v"], cwd=folder, capture_output=True, check=True)
    assert '"outcome": "passed"' in result.stdout, result.stdout[-3000:] + result.stderr[-3000:]
    assert result.returncode == 0


def test_host_isolation_leases_and_refuses_foreign_traffic(tmp_path: Path) -> None:
    words = ["sil-closed-straight", "--isolation", "host", "--report", str(tmp_path / "report")]
    process = start(tmp_path, *words)
    out, _ = process.communicate(timeout=120)
    assert process.returncode == 0, out
    (test,) = results(tmp_path / "report").values()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
        stranger.connect(group(test["cid"]))
        port = stranger.getsockname()[1]
        second = start(tmp_path, *words)
        while second.poll() is None:
            stranger.send(b"\x0d\xa4\x00\x00\x00")
            time.sleep(0.02)
    out, _ = second.communicate()
    assert second.returncode == 3, out
    (test,) = results(tmp_path / "report").values()
    assert f":{port}; end it" in str(test["reason"])
