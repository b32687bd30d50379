"""The same tests in containers of a real engine: isolated from each other, and gone afterwards."""

import contextlib
import json
import os
import re
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from dodo_dsl.outcome import differs_each_run
from tests.docker.compose import Crate
from tests.drive.applications import ROOT, dodo, results
from tests.realtime import wait_for_nobody
from tests.run.desk import wait_for
from tests.run.helpers import WAIT

DRIVE = "sil-closed-straight"
DOCKER = ("--backend", "docker")

pytestmark = [pytest.mark.engine, pytest.mark.usefixtures("images")]


def of_dodo() -> set[str]:
    """The containers, networks and volumes of tests that the engine holds, without those that have a mark."""
    lists = (
        ("ps", "-a", "--format", "container {{.Names}}"),
        ("network", "ls", "--format", "network {{.Name}}"),
        ("volume", "ls", "--format", "volume {{.Name}}"),
    )
    found = (subprocess.run(["docker", *w], capture_output=True, text=True, check=True).stdout for w in lists)
    return {line for text in found for line in text.splitlines() if " dodo-" in line}


@pytest.fixture(autouse=True)
def clean_engine(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Every test leaves the engine as it was; what other runs on this machine have there, they take down."""
    monkeypatch.setenv("DODO_LEASES", str(tmp_path / "leases"))
    before = of_dodo()
    yield
    deadline = time.monotonic() + 60
    while (left := of_dodo() - before) and time.monotonic() < deadline:
        time.sleep(0.2)
    assert left == set()


HARMS = """
import contextlib, itertools, socket, threading
import sysv_ipc
from dodo_dsl.opendlv.address import group

def flood():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        for turn in itertools.count():
            sender.sendto(os.urandom(100 if turn % 2 else 20_000), group(111))
            if turn % 200 == 0:
                time.sleep(0.01)

def groups():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        while True:
            for cid in range(1, 255):
                sender.sendto(b"hostile", group(cid))
            time.sleep(0.05)

def memory():
    while True:
        open("/tmp/video1.argb", "w").close()
        sysv_ipc.SharedMemory(sysv_ipc.ftok("/tmp/video1.argb", 1, True), sysv_ipc.IPC_CREAT, size=1000)
        for line in list(open("/proc/sysvipc/shm"))[1:]:
            segment = sysv_ipc.SharedMemory(int(line.split()[0]))
            segment.write(bytes(segment.size))
            segment.detach()
        time.sleep(0.02)

def tmp():
    for number in itertools.count():
        with contextlib.suppress(OSError), open(f"/tmp/filler-{number % 1000}", "wb") as file:
            file.write(os.urandom(1 << 20))
        time.sleep(0.01 if number < 1000 else 0.1)

threads = [threading.Thread(target=harm, daemon=True) for harm in (flood, groups, memory, tmp)]
for thread in threads:
    thread.start()
while not os.path.exists("{stop}"):
    assert all(map(threading.Thread.is_alive, threads))
    time.sleep(0.1)
"""
FEELS = """
import socket
from dodo_dsl.opendlv.address import group
from dodo_dsl.opendlv.shared_memory import SharedMemory
bus = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
bus.bind(group(110))
bus.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, socket.inet_aton(group(110)[0]) + bytes(4))
bus.settimeout(2)
with SharedMemory.create("video0.argb", 1000) as memory:
    memory.buffer[:1000] = b"x" * 1000
    print('{"dodo": "ready"}', flush=True)
    while not os.path.exists("/tmp/app-began"):
        time.sleep(0.02)
    felt = []
    try:
        felt.append(f"heard {bus.recv(1000)[:20]}")
    except TimeoutError:
        pass
    if bytes(memory.buffer[:1000]) != b"x" * 1000:
        felt.append("written over")
    felt += [name for name in os.listdir("/tmp") if name.startswith("filler")]
outcome = "failed" if felt else "passed"
print(f'{{"dodo": "verdict", "outcome": "{outcome}", "reason": "felt {len(felt)}", "checks": []}}', flush=True)
"""


def test_a_hostile_neighbour_is_neither_heard_nor_felt(crate: Crate) -> None:
    """It floods its bus, sends to all groups, writes into all shared memory and fills its ``/tmp`` meanwhile."""
    stop = crate.bench.folder / "stop"
    hostile = crate.start(crate.job("hostile", application=HARMS.replace("{stop}", str(stop))))
    try:
        wait_for(hostile, "running")
        (outcome,) = crate.run(crate.job("quiet", FEELS, "open('/tmp/app-began', 'w').close()\n" + WAIT)).values()
        assert hostile.poll() is None, (crate.log("hostile"), outcome)
    finally:
        stop.touch()
        said, _ = hostile.communicate(timeout=600)
    assert (outcome.outcome, outcome.reason) == ("passed", "felt 0")
    assert re.search(r"^FAILED .*application service 'app' ended with exit code 0", said, re.MULTILINE), said


def hurry_emulators(until: threading.Event) -> None:
    """What an emulator does for itself elsewhere: a container's control group has no share of real time.

    Each one and its gantry as soon as they are there, so that it is in time while its axes find their home, too.
    """
    begun: set[str] = set()
    while not until.wait(0.1):
        listed = subprocess.run(
            ["pgrep", "-f", r"rig-emulator|services\.gantry"], capture_output=True, text=True, check=False
        ).stdout
        for process in set(listed.split()) - begun:
            with contextlib.suppress(OSError):  # only version 1 has such groups
                Path("/sys/fs/cgroup/cpu/cgroup.procs").write_text(process)
            wait_for_nobody(int(process))
            begun.add(process)


@pytest.mark.proof
def test_the_emulated_rig_in_containers(tmp_path: Path) -> None:
    """A machine that is too busy for the emulated rig gets two more tries; test_images tries the image's emulator."""
    if not (ROOT / "build" / "firmware" / "rig-emulator").exists():
        pytest.skip("the emulated rig is not built: make firmware")
    report, ended = tmp_path / "report", threading.Event()
    helper = threading.Thread(target=hurry_emulators, args=(ended,))
    helper.start()
    try:
        dodo("run", "hil-dynamic", *DOCKER, "--retry-errors", "2", "--report", str(report), code=0)
    finally:
        ended.set()
        helper.join()
    assert {test["outcome"] for test in results(report).values()} == {"passed"}
    assert (report / "hil-dynamic" / "snapshot.png").read_bytes().startswith(b"\x89PNG")


def test_compiled_test_runs_by_hand(tmp_path: Path) -> None:
    """``cd DIR/<slug> && docker compose up``: the verdict stands in the log, whatever lies above.

    It is that of ``dodo run`` with every combination of sides: what the clock of lockstep gives is the same.
    """
    out = tmp_path / "generated"
    (tmp_path / "docker-compose.yml").write_text("services: {stranger: {image: stranger}}\n")
    subprocess.run([sys.executable, "-m", "dodo_dsl", "compile", DRIVE, "-o", str(out)], cwd=ROOT, check=True)
    folder = out / DRIVE
    up = ["docker", "compose", "up", "--build", "--exit-code-from", "track"]  # the engine may have an older example
    for n in range(100, 116):  # as somebody would who shares the engine with others
        variables = {**os.environ, "DODO_SUBNET": f"10.213.{n}.0/28"}
        result = subprocess.run(up, cwd=folder, env=variables, capture_output=True, text=True, check=False, timeout=900)
        subprocess.run(["docker", "compose", "down", "-v"], cwd=folder, env=variables, capture_output=True, check=True)
        if "Pool overlaps" not in result.stderr:
            break
    said = [line[line.index("{") :] for line in result.stdout.splitlines() if '"dodo": "verdict"' in line]
    assert result.returncode == 0 and said, result.stdout[-3000:] + result.stderr[-3000:]
    verdict = json.loads(said[0])
    assert verdict["outcome"] == "passed"
    values = [verdict["checks"]]
    for backend in ("docker", "process", *(["mixed"] if os.geteuid() == 0 else [])):
        report = ("--report", str(tmp_path / backend))
        dodo("run", "--compiled", str(folder), "--backend", backend, *report, code=0)
        ours = results(tmp_path / backend)[DRIVE]
        assert (ours["clock"], ours["backend"]) == ("lockstep", backend)
        assert (tmp_path / backend / DRIVE / "trajectory.png").is_file()
        assert (tmp_path / backend / DRIVE / "test.rec").stat().st_size > 10_000
        values.append(ours["checks"])
    of_hand, *of_runs = ({c["name"]: c["value"] for c in each if not differs_each_run(c["name"])} for each in values)
    assert len(of_hand) > 3 and all(each == of_hand for each in of_runs)


@pytest.mark.proof
def test_host_isolation(tmp_path: Path) -> None:
    dodo("run", "sil-closed-left-curve", *DOCKER, "--isolation", "host", "--report", str(tmp_path), code=0)
