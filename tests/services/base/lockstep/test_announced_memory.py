import os
from collections.abc import Iterator

import pytest

from dodo_dsl.opendlv.shared_memory import SharedMemory
from services.base.lockstep_clock import AnnouncedMemory


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
    put(memory, b"old!", 1_700_000_000_000_000)
    memory.announce()
    put(memory, b"new!", 1_700_000_000_100_000)
    assert (memory.is_new, memory.sampled) == (True, 1_700_000_000_100_000)
    assert seen(memory) == (b"old!", 1_700_000_000_000_000)
    memory.announce()
    assert not memory.is_new
    assert seen(memory) == (b"new!", 1_700_000_000_100_000)
