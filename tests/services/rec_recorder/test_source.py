import os
from collections.abc import Iterator

import pytest

from dodo_dsl.opendlv.shared_memory import SharedMemory
from services.rec_recorder.source import MemorySpec, PictureSource, SourceError, parse

PERIOD = 100_000


@pytest.fixture
def memory() -> Iterator[SharedMemory]:
    with SharedMemory.create(f"rec-{os.getpid()}.i420", 6) as memory:
        yield memory


def put(memory: SharedMemory, byte: int, time: int) -> None:
    with memory.lock():
        memory.buffer[:] = bytes([byte]) * memory.size
        memory.stamp(time)


def taken(source: PictureSource, memory: SharedMemory, times: list[int]) -> list[int]:
    got = []
    for number, time in enumerate(times):
        put(memory, number, time)
        picture = source.take(0)
        if picture is not None:
            assert picture == (bytes([number]) * memory.size, time)
            got.append(time // 1000)
        assert source.take(0) is None
    return got


@pytest.mark.parametrize(
    ("times_ms", "wanted_ms"),
    [
        (list(range(1000, 2000, 100)), list(range(1000, 2000, 100))),
        (list(range(1000, 1500, 50)), [1000, 1100, 1200, 1300, 1400]),
        ([1000, 1099, 1201, 1299, 1400], [1000, 1099, 1201, 1299, 1400]),  # jitter of a camera of the same rate
        ([1000, 1133, 1266, 1400, 1533], [1000, 1133, 1266, 1400, 1533]),  # a slower camera
        ([1000, 1060, 1120, 1180, 1240], [1000, 1120, 1240]),
        ([5000, 5050, 1000, 1050, 1100], [5000, 1000, 1100]),  # a player rewound
        ([1000, 90000, 90050, 90100], [1000, 90000, 90100]),  # a pause
    ],
)
def test_pictures_at_a_rate(memory: SharedMemory, times_ms: list[int], wanted_ms: list[int]) -> None:
    source = PictureSource(MemorySpec(memory.name), PERIOD)
    assert source.take(0) is None  # what was there before
    assert taken(source, memory, [t * 1000 for t in times_ms]) == wanted_ms
    source.close()


def test_in_lockstep_the_first_picture_is_taken_and_nothing_before(memory: SharedMemory) -> None:
    source = PictureSource(MemorySpec(memory.name), PERIOD, is_stepped=True)
    assert source.take(1_000_000) is None  # its file is of today
    put(memory, 7, 2_000_000)
    assert source.take(2_000_000) == (bytes([7]) * memory.size, 2_000_000)
    source.close()


def test_a_memory_that_comes_and_goes(memory: SharedMemory) -> None:
    name = f"{memory.name}.late"
    source = PictureSource(MemorySpec(name), PERIOD)
    assert source.take(0) is None
    for start in (1, 3):
        with SharedMemory.create(name, 6) as late:
            assert source.take(start * 1_000_000) is None
            assert taken(source, late, [start]) == [0]
        assert source.take(start * 1_000_000 + 1) is None  # it is gone


@pytest.mark.parametrize(
    ("text", "size", "layout"),
    [
        ("video0.argb:640x480", 640 * 480 * 4, ("argb", 640, 480)),
        ("video0.argb:640x480", 640 * 480 * 3, ("bgr", 640, 480)),
        ("img.i420:62x46", 62 * 46 * 3 // 2, ("i420", 62, 46)),
        ("img.i420", 1280 * 720 * 3 // 2, ("i420", 1280, 720)),
        ("img.argb", 640 * 480 * 4, ("argb", 640, 480)),
        ("camera", 640 * 480 * 4, ("argb", 640, 480)),
    ],
)
def test_layouts(text: str, size: int, layout: tuple[str, int, int]) -> None:
    assert parse(text).layout(size) == layout


@pytest.mark.parametrize(
    ("text", "size", "problem"),
    [
        ("a.argb:640x480", 5, "memory 'a.argb' has 5 bytes, not those of a picture of 640 x 480 pixels"),
        ("a.argb", 5, "memory 'a.argb' has 5 bytes, not those of a common size: write a.argb:WIDTHxHEIGHT"),
    ],
)
def test_memories_without_pictures(text: str, size: int, problem: str) -> None:
    with pytest.raises(SourceError) as caught:
        parse(text).layout(size)
    assert str(caught.value) == problem


@pytest.mark.parametrize("text", ["", ":640x480", "a:640", "a:0x480", "a:640x480x3"])
def test_memories_written_wrongly(text: str) -> None:
    with pytest.raises(SourceError, match="is not a memory to record, expected a name such as"):
        parse(text)
