"""Slots on the host: leased, without foreign traffic, and empty when they are given back."""

import asyncio
import contextlib
import os
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from dodo_dsl.run import capabilities, leases
from dodo_dsl.run.process import leftovers
from dodo_dsl.run.process.host_isolation import host_slot, isolation_refusal
from dodo_dsl.run.process.slot import SLOT_VARIABLE, Slot
from dodo_dsl.run.protocol import BackendError
from tests.run.desk import ROOT
from tests.run.scripted import plan

SHARES = """
import time
from dodo_dsl.opendlv.shared_memory import SharedMemory
memory = SharedMemory.create("{name}", 100)
print("shared", flush=True)
time.sleep(600)
"""
SLEEPS = [sys.executable, "-c", "import time; time.sleep(600)"]


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("DODO_LEASES", str(tmp_path / "leases"))
    return tmp_path / "leases"


@pytest.fixture
def traffic(cid: int) -> Iterator[int]:
    """Somebody sends on a CID; gives its port."""
    over = threading.Event()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
        stranger.connect((f"225.0.0.{cid}", 12175))

        def send() -> None:
            while not over.wait(0.01):
                stranger.send(b"\x0d\xa4\x00\x00\x00")

        sender = threading.Thread(target=send)
        sender.start()
        yield stranger.getsockname()[1]
        over.set()
        sender.join()


def leased(cid: int, alone: bool = False) -> Slot:
    async def scene() -> Slot:
        async with host_slot(plan(cid=cid), (cid,), print, alone=alone) as slot:
            return slot

    return asyncio.run(scene())


def test_foreign_traffic_is_an_error_that_names_its_sender(cid: int, traffic: int, folder: Path) -> None:
    with pytest.raises(BackendError, match=rf"CID {cid} carries foreign traffic from [0-9.]+:{traffic}; end it, or "):
        leased(cid)
    assert list(folder.glob("*.lease")) == []


@pytest.mark.slow
def test_a_slot_has_names_of_its_own_unless_it_is_alone(cid: int, folder: Path) -> None:
    slots = [leased(cid), leased(cid), leased(cid, alone=True)]
    assert all(leftovers.SLOT_NAME.fullmatch(slot.name) for slot in slots)
    assert [slot.memory_prefix for slot in slots] == [slots[0].name, slots[1].name, ""]
    assert slots[0].name != slots[1].name
    assert list(folder.glob("*.lease")) == []


@pytest.mark.slow
def test_what_a_killed_run_left_is_removed(cid: int, folder: Path) -> None:
    """Processes of its slot, its shared memory and ready files, and its record."""
    name = f"dodo-{os.getpid():08x}-"
    lease = leases.try_lease(f"cid-{cid}", {"test": "killed", "slot": name})
    assert lease is not None
    environment = {**os.environ, SLOT_VARIABLE: name, "PYTHONPATH": str(ROOT)}
    shares = [sys.executable, "-c", SHARES.format(name=f"{name}video0.argb")]
    with (
        subprocess.Popen(shares, env=environment, stdout=subprocess.PIPE) as mine,
        subprocess.Popen(SLEEPS) as other,
        contextlib.ExitStack() as stack,
    ):
        stack.callback(mine.kill)
        stack.callback(other.kill)
        assert mine.stdout is not None and mine.stdout.readline() == b"shared\n"
        assert leftovers.reap() == [], "it is still held"
        lease.leave()
        assert leftovers.reap() == ["killed: 1 processes and 1 shared memories"]
        assert (mine.wait(), other.poll()) == (-15, None)
    assert list(Path("/tmp").glob(f"{name}*")) == list(folder.glob("*.lease")) == []
    assert leftovers.reap() == []


@pytest.mark.parametrize(
    ("bwrap", "told"),
    [
        ("", "there is no program 'bwrap': install bubblewrap"),
        ("echo bwrap: something odd >&2; exit 1", "the kernel refuses namespaces (bwrap: something odd): allow "),
    ],
)
def test_what_is_missing_is_blamed(bwrap: str, told: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    if bwrap:
        (tmp_path / "bwrap").write_text(f"#!/bin/sh\n{bwrap}\n")
        (tmp_path / "bwrap").chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path))
    assert isolation_refusal().startswith(told)
    (finding,) = capabilities.namespaces()
    assert (finding.state, told in finding.text) == ("problem", True)


def test_where_the_kernel_refuses_namespaces_they_are_to_be_allowed() -> None:
    """In a user namespace that may have no further ones with mounts."""
    script = "from dodo_dsl.run.process import host_isolation as h; print(h.isolation_refusal())"
    limits = 'echo 0 > /proc/sys/user/max_mnt_namespaces && exec "$@"'
    unshare = ["unshare", "--user", "--map-root-user", "sh", "-c", limits, "sh", sys.executable, "-c", script]
    done = subprocess.run(unshare, capture_output=True, text=True, check=False, cwd=ROOT)
    if done.stderr.startswith("unshare:"):
        pytest.skip(done.stderr)
    assert "the kernel refuses namespaces (bwrap: " in done.stdout and "to make namespaces" in done.stdout, done


def test_a_built_in_cid_of_real_cars_is_refused_on_the_host() -> None:
    async def take() -> None:
        async with host_slot(plan(cid=111), (130,), print, alone=True):
            pass

    with pytest.raises(BackendError, match="the application has the CID 111 built in, which real cars use"):
        asyncio.run(take())
