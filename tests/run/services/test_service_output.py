"""A service's output: complete in its log, its last lines in memory, its lines to a callback."""

import asyncio
import contextlib
import os
import threading
import time
import tty
from collections.abc import Sequence
from pathlib import Path

import pytest

from dodo_dsl.run import service_output
from dodo_dsl.run.service_output import ServiceOutput


class Read:
    """What an Output made of the chunks that a service wrote."""

    def __init__(
        self, folder: Path, chunks: Sequence[bytes], is_hung: bool = False, terminal: bool = False, cooked: bool = False
    ) -> None:
        self.lines: list[bytes] = []
        self.kinds = terminal, cooked
        self.log_path = folder / "logs" / "app.log"
        asyncio.run(self._read(chunks, is_hung))
        self.log = self.log_path.read_bytes()

    async def _read(self, chunks: Sequence[bytes], is_hung: bool) -> None:
        output = ServiceOutput(self.log_path, self._take, *self.kinds)
        os.set_blocking(output.writer, False)
        writer = os.dup(output.writer)
        output.release_writer()
        for chunk in chunks:
            rest = memoryview(chunk)
            while rest:
                with contextlib.suppress(BlockingIOError):  # a terminal holds 4 KiB
                    rest = rest[os.write(writer, rest[:4096]) :]
                await asyncio.sleep(0)
        if is_hung:
            output.close()
            assert output.done.is_set()
        os.close(writer)
        await asyncio.wait_for(output.done.wait(), 10)
        output.close()
        self.tail = output.tail()

    def _take(self, line: bytes) -> bool:
        self.lines.append(line)
        return line.startswith(b"{")


def test_the_returns_of_a_terminal_in_a_container_are_taken_off(tmp_path: Path) -> None:
    read = Read(tmp_path, [b"a\r\nb\r\r", b"\nc\r\n"], cooked=True)
    assert (read.lines, read.log) == ([b"a", b"b\r", b"c"], b"a\nb\r\nc\n")


def test_a_long_line_is_in_the_log_and_its_begin_in_the_tail(tmp_path: Path) -> None:
    """Longer than a line of the protocol may be, so that it is not one."""
    long = b"x" * 200_000
    read = Read(tmp_path, [b"before\n", long, b"\nafter\n", b"end"])
    assert read.log == b"before\n" + long + b"\nafter\nend"
    assert read.lines == [b"before", b"after", b"end"]
    assert read.tail == ["before", "x" * 300, "after", "end"]


def test_lines_count_beyond_the_limit_of_the_log(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(service_output, "_MAX_LOG", 1 << 20)
    lines = b"".join(b"%07d\n" % n for n in range(200_000))
    read = Read(tmp_path, [lines, b'{"dodo": "verdict"}\n'])
    assert read.lines[-1] == b'{"dodo": "verdict"}'
    assert len(read.lines) == 200_001
    assert len(read.log) < (1 << 20) + 100
    assert read.log.endswith(b"\n... dodo: the log ends here, at 1 MiB\n")


def test_a_service_that_keeps_its_output_open_is_not_waited_for(tmp_path: Path) -> None:
    read = Read(tmp_path, [b"a\n", b"b"], is_hung=True)
    assert (read.lines, read.log) == ([b"a", b"b"], b"a\nb")


def test_a_terminal_is_read_empty_where_its_program_rests(tmp_path: Path) -> None:
    """And says whether so much came that the program may only have waited for room."""
    matched: list[bytes] = []

    async def take(lines: Sequence[bytes]) -> None:
        await asyncio.sleep(0.01)
        matched.extend(lines)

    async def scene() -> None:
        output = ServiceOutput(tmp_path / "app.log", lambda _: False, terminal=True, match=take)
        os.write(output.writer, b"a\nb\nunfin")
        assert not await output.read_empty()
        assert matched == [b"a", b"b", b"unfin"]
        assert not await output.read_empty()
        os.write(output.writer, b"\n")
        assert not await output.read_empty()
        assert matched.pop() == b"unfin", "it counts once"
        os.write(output.writer, b"as it is\n" + b"x" * 4000 + b"\n")
        await asyncio.sleep(0.05)
        os.write(output.writer, b"y" * 100 + b"\n")
        assert await output.read_empty()
        assert [len(line) for line in matched[2:]] == [8, 4000, 100]
        output.release_writer()
        await asyncio.wait_for(output.done.wait(), 10)
        assert not await output.read_empty()
        output.close()

    asyncio.run(scene())


def test_another_terminal_says_what_was_printed_until_now(tmp_path: Path) -> None:
    """By what it echoes, which its program never gets; one that echoes nothing is given up."""
    lines: list[bytes] = []

    async def take(found: Sequence[bytes]) -> None:
        lines.extend(found)

    async def scene() -> None:
        output = ServiceOutput(tmp_path / "app.log", lambda _: False, is_cooked=True, match=take)
        outer, inner = os.openpty()
        output.type_in = lambda data: os.write(outer, data) and None

        def carry() -> None:
            with contextlib.suppress(OSError):
                while data := os.read(outer, 7):
                    time.sleep(0.001)
                    os.write(output.writer, data)

        thread = threading.Thread(target=carry, daemon=True)
        thread.start()
        for number in range(20):
            os.write(inner, b"line %d\nnot " % number)
            await output.read_empty()
            assert lines[-2:] == [b"not " * bool(number) + b"line %d" % number, b"not "]
        os.set_blocking(inner, False)
        with pytest.raises(BlockingIOError):
            os.read(inner, 1)
        tty.setraw(inner)
        with pytest.raises(TimeoutError):
            await output.read_empty()
        os.close(inner)
        thread.join()
        output.release_writer()
        await asyncio.wait_for(output.done.wait(), 10)
        output.close()

    service_output._ECHO_S, before = 0.5, service_output._ECHO_S
    try:
        asyncio.run(scene())
    finally:
        service_output._ECHO_S = before
    assert b"^R" not in (tmp_path / "app.log").read_bytes()
