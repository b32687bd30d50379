import contextlib
import multiprocessing
import os
import signal
import threading
import time
from pathlib import Path

import numpy as np
import pytest
import sysv_ipc

from dodo_dsl.opendlv import sysv_memory
from dodo_dsl.opendlv.shared_memory import SharedMemory, SharedMemoryError
from tests.opendlv.conftest import Peer

SIZE = 64 * 48 * 4
NOBODY = 65534
TIME = 1_715_000_000_123_456


def until_waiting(memory: SharedMemory, readers: int) -> None:
    deadline = time.monotonic() + 10.0
    while memory.readers_waiting() < readers:
        assert time.monotonic() < deadline, "nobody waits"
        time.sleep(0.001)


def write(memory: SharedMemory, byte: int, time_us: int) -> None:
    with memory.lock():
        np.frombuffer(memory.buffer, np.uint8)[:] = byte
        memory.stamp(time_us)
    memory.notify_all()


def test_libcluon_reads_each_frame_once(mode: str, peer: Peer, memory_name: str) -> None:
    with SharedMemory.create(memory_name, SIZE) as memory:
        assert peer.ask("attach", name=memory_name) == {"valid": True}
        peer.order("wait", name=memory_name, frames=50)
        for frame in range(50):
            until_waiting(memory, 1)
            write(memory, frame, TIME + frame)
            assert peer.answer() == {"byte": frame, "same": True, "size": SIZE, "time": TIME + frame}
        peer.ask("close", name=memory_name)


def test_frames_of_libcluon_are_read(mode: str, peer: Peer, memory_name: str) -> None:
    assert peer.ask("create", name=memory_name, size=SIZE) == {"valid": True}
    with SharedMemory.attach(memory_name) as memory:
        assert memory.size == SIZE
        reader = threading.Thread(target=memory.wait, args=(10.0,))
        reader.start()
        until_waiting(memory, 1)
        peer.ask("fill", name=memory_name, byte=9, time=TIME)
        reader.join(10.0)
        assert not reader.is_alive()
        with memory.lock():
            assert set(memory.buffer) == {9}
            assert memory.sample_time() == TIME
        peer.ask("close", name=memory_name)
        if mode == "sysv":
            with pytest.raises(SharedMemoryError, match="was removed by its creator"):
                memory.wait(1.0)


def test_waiting_ends_with_the_timeout_or_a_signal(memory_name: str) -> None:
    with SharedMemory.create(memory_name, 1) as memory:
        assert memory.wait(0.0) is False
        assert memory.wait(0.02) is False
        old = signal.signal(signal.SIGALRM, lambda *_: None)
        signal.setitimer(signal.ITIMER_REAL, 0.02)
        assert memory.wait(None) is False
        signal.signal(signal.SIGALRM, old)


def _die_while_locked(name: str) -> None:
    memory = SharedMemory.attach(name)
    memory.lock().__enter__()
    os._exit(0)


@pytest.mark.slow
def test_a_dead_holder_of_the_lock_holds_it_no_more(mode: str, memory_name: str) -> None:
    with SharedMemory.create(memory_name, 1) as memory:
        process = multiprocessing.get_context("spawn").Process(target=_die_while_locked, args=(memory_name,))
        process.start()
        process.join(20.0)
        assert process.exitcode == 0
        with memory.lock(timeout=5.0):
            memory.stamp(-1)
            assert memory.sample_time() == -1


def test_a_lock_held_by_another_is_an_error_in_the_end(mode: str, memory_name: str) -> None:
    with (
        SharedMemory.create(memory_name, 1) as memory,
        SharedMemory.attach(memory_name) as other,
        other.lock(),
        pytest.raises(SharedMemoryError, match=r"was locked by another for 0\.05 s"),
        memory.lock(timeout=0.05),
    ):
        pass


def _create_and_die(name: str) -> None:
    SharedMemory.create(name, 10)
    os._exit(0)


@pytest.mark.slow
def test_what_a_dead_creator_left_is_replaced(mode: str, memory_name: str) -> None:
    process = multiprocessing.get_context("spawn").Process(target=_create_and_die, args=(memory_name,))
    process.start()
    process.join(20.0)
    with SharedMemory.attach(memory_name) as left:
        assert left.size == 10
    with SharedMemory.create(memory_name, 20) as memory:
        assert memory.size == 20 and set(memory.buffer) == {0}


def test_memory_of_a_living_creator_is_not_taken(mode: str, memory_name: str) -> None:
    text = f"process {os.getpid()} uses it" if mode == "sysv" else "a living process uses it"
    with SharedMemory.create(memory_name, 10), pytest.raises(SharedMemoryError, match=text):
        SharedMemory.create(memory_name, 10)


def test_colliding_keys_are_avoided(memory_name: str) -> None:
    path, twin = Path("/tmp", memory_name), Path("/tmp", f"{memory_name}.twin")
    twin.touch()
    os.link(twin, path)  # the same inode gives the same keys, as two inodes 65536 apart would
    try:
        assert sysv_memory.twin_token(path)
        with SharedMemory.create(memory_name, 10) as memory:
            assert not sysv_memory.twin_token(path)
            memory.buffer[0] = 1
            with SharedMemory.attach(memory_name) as reader:
                assert reader.buffer[0] == 1
    finally:
        twin.unlink()


@pytest.mark.skipif(os.geteuid() != 0, reason="needs another user")
def test_another_user_reads_it_whatever_the_umask(mode: str, memory_name: str) -> None:
    before = os.umask(0o077)
    try:
        memory = SharedMemory.create(memory_name, SIZE)
    finally:
        os.umask(before)
    with memory:
        reader = multiprocessing.get_context("fork").Process(target=attach_as_nobody, args=(memory_name,))
        reader.start()
        reader.join()
        assert reader.exitcode == 0


def attach_as_nobody(name: str) -> None:
    os.setuid(NOBODY)
    with SharedMemory.attach(name) as memory, memory.lock():
        pass


@pytest.mark.skipif(os.geteuid() != 0, reason="needs another user")
def test_what_another_user_left_under_these_keys_is_avoided(memory_name: str) -> None:
    token = Path("/tmp", memory_name)
    token.touch()
    os.chown(token, NOBODY, NOBODY)
    left = sysv_ipc.SharedMemory(sysv_memory.token_key(token.stat(), 1), sysv_ipc.IPC_CREX, size=10, mode=0o666)
    left.detach()
    try:
        creator = multiprocessing.get_context("fork").Process(target=create_as_nobody, args=(memory_name,))
        creator.start()
        creator.join()
        assert creator.exitcode == 0
    finally:
        left.remove()
        token.unlink(missing_ok=True)


def create_as_nobody(name: str) -> None:
    os.setuid(NOBODY)
    with SharedMemory.create(name, 20) as memory:
        assert memory.size == 20


def test_memory_that_is_not_there(memory_name: str) -> None:
    with pytest.raises(SharedMemoryError, match=f"'{memory_name}' does not exist: /tmp/{memory_name}"):
        SharedMemory.attach(memory_name)
    token = Path("/tmp", memory_name)
    token.touch()
    with pytest.raises(SharedMemoryError, match="has no content"):
        SharedMemory.attach(memory_name)
    token.unlink()


@pytest.mark.parametrize(("name", "size"), [("", 1), ("/", 1), ("a\0b", 1), ("x" * 300, 1), ("x", 0), ("x", 2**32)])
def test_names_and_sizes_that_cannot_be(name: str, size: int) -> None:
    with pytest.raises(SharedMemoryError):
        SharedMemory.create(name, size)


def test_a_reader_finds_the_mode_of_the_creator(mode: str, memory_name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    with SharedMemory.create(memory_name, 12) as memory:
        assert Path("/tmp", memory_name).exists() is (mode == "sysv")
        assert Path("/dev/shm", memory_name).exists() is (mode == "posix")
        monkeypatch.setenv("CLUON_SHAREDMEMORY_POSIX", "0" if mode == "posix" else "1")
        with SharedMemory.attach(f"/{memory_name}") as reader:
            memory.buffer[11] = 5
            assert (reader.size, reader.buffer[11]) == (12, 5)


def test_whom_the_end_wakes_does_not_read_the_last_content_again(
    mode: str, memory_name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """However long its creator is kept from going on once it has woken the reader."""
    memory = SharedMemory.create(memory_name, SIZE)
    write(memory, 7, TIME)
    wake, is_over, seen = memory._segment.wake, threading.Event(), list[int]()

    def late() -> None:
        wake()
        reader.join(10.0)

    def read() -> None:
        with SharedMemory.attach(memory_name) as theirs, contextlib.suppress(SharedMemoryError):
            theirs.wait()
            with theirs.lock():
                seen.append(theirs.buffer[0])
        is_over.set()

    reader = threading.Thread(target=read)
    reader.start()
    until_waiting(memory, 1)
    monkeypatch.setattr(type(memory._segment), "wake", lambda _: late())
    memory.close()
    assert is_over.is_set() and seen == []


def test_waiting_for_posix_memory_ends(memory_name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CLUON_SHAREDMEMORY_POSIX", "1")
    with SharedMemory.create(memory_name, 1) as memory, SharedMemory.attach(memory_name) as reader:
        assert reader.wait(0.0) is False
        assert reader.wait(0.02) is False
        failures: list[str] = []

        def wait() -> None:
            try:
                reader.wait(None)
            except SharedMemoryError as error:
                failures.append(str(error))

        thread = threading.Thread(target=wait)
        thread.start()
        until_waiting(memory, 1)
        memory.close()
        thread.join(10.0)
    assert failures == [f"shared memory '{memory_name}' was removed by its creator"]


def _wait_for_ever(name: str) -> None:
    with SharedMemory.attach(name) as memory:
        while True:
            memory.wait(None)


@pytest.mark.slow
def test_a_killed_reader_blocks_nobody(mode: str, memory_name: str) -> None:
    context = multiprocessing.get_context("spawn")
    with SharedMemory.create(memory_name, 1) as memory:
        failure = ""
        for _ in range(3):
            process = context.Process(target=_wait_for_ever, args=(memory_name,))
            process.start()
            before = memory.readers_waiting()
            until_waiting(memory, before + 1)
            process.kill()
            process.join(20.0)
            try:
                memory.notify_all()
            except SharedMemoryError as error:
                failure = str(error)
                break
    told = f"shared memory '{memory_name}' cannot notify any more: a reader was killed while it waited"
    assert failure == ("" if mode == "sysv" else told)
