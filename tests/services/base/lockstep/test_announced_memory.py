import os
import threading
from collections.abc import Iterator

import pytest

from dodo_dsl.opendlv.shared_memory import SharedMemory
from services.base.lockstep_clock import AnnouncedMemory, Announcer


@pytest.fixture
def memory() -> Iterator[AnnouncedMemory]:
    with AnnouncedMemory.create(f"dodo-test-{os.getpid()}-announced", 4) as memory:
        yield memory


def put(memory: AnnouncedMemory, picture: bytes, time: int) -> None:
    with memory.lock():
        memory.buffer[:] = picture
        memory.stamp(time)
    memory.notify_all()


def seen(memory: AnnouncedMemory) -> tuple[bytes, int]:
    with SharedMemory.attach(memory.name) as reader, reader.lock():
        return bytes(reader.buffer), reader.sample_time()


def test_a_picture_is_seen_when_it_is_announced(memory: AnnouncedMemory) -> None:
    announcer = Announcer(readers=0)
    announcer.memories.append(memory)
    put(memory, b"old!", 1_700_000_000_000_000)
    announcer.announce()
    put(memory, b"new!", 1_700_000_000_100_000)
    assert (announcer.new, announcer.sampled) == ([memory], 1_700_000_000_100_000)
    assert seen(memory) == (b"old!", 1_700_000_000_000_000)
    announcer.announce()
    assert announcer.new == []
    assert seen(memory) == (b"new!", 1_700_000_000_100_000)


def test_readers_are_awaited_and_woken(memory: AnnouncedMemory) -> None:
    announcer, woken = Announcer(readers=1), []
    announcer.memories.append(memory)

    def read() -> None:
        with SharedMemory.attach(memory.name) as reader:
            woken.append(reader.wait(20.0))

    thread = threading.Thread(target=read)
    thread.start()
    assert announcer.await_readers(lambda: False)
    put(memory, b"new!", 7)
    announcer.announce()
    thread.join()
    assert woken == [True]


def test_who_is_stopped_awaits_nobody(memory: AnnouncedMemory) -> None:
    announcer = Announcer(readers=1)
    announcer.memories.append(memory)
    assert not announcer.await_readers(lambda: True)
