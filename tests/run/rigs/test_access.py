"""Manual access to a rig: what its program answers, and how it ends."""

import asyncio
import os
import signal
import sys
from pathlib import Path

import pytest

from dodo_dsl.run.rigs import access
from dodo_dsl.run.rigs.access import occupied, query
from dodo_dsl.run.rigs.problems import ProgramTimeout, RigProblem

PYTHON = (sys.executable, "-c")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("program", "kind", "sentence", "usage"),
    [
        ("import sys; sys.exit('no such port')", RigProblem, "the rig's program gave no answer: no such port", False),
        ("pass", RigProblem, "the rig's program gave no answer: no output", False),
        ("""print('{"error": "it is lost"}'); raise SystemExit(1)""", RigProblem, "it is lost", False),
        ("""print('{"error": "out of range"}'); raise SystemExit(2)""", RigProblem, "out of range", True),
    ],
)
def test_a_program_without_an_answer(program: str, kind: type[RigProblem], sentence: str, usage: bool) -> None:
    with pytest.raises(RigProblem) as caught:
        asyncio.run(query(PYTHON, [program]))
    assert (type(caught.value), str(caught.value), caught.value.usage) == (kind, sentence, usage)


def test_an_answer_from_a_program_that_holds_the_leases() -> None:
    reader, writer = os.pipe()
    program = f"""import os, json; print(json.dumps({{"open": os.path.exists("/proc/self/fd/{writer}")}}))"""
    try:
        assert asyncio.run(query(PYTHON, [program], descriptors=(writer,))) == {"open": True}
        assert asyncio.run(query(PYTHON, [program])) == {"open": False}
    finally:
        os.close(reader)
        os.close(writer)


@pytest.mark.thorough
def test_a_program_that_hangs_is_ended() -> None:
    with pytest.raises(ProgramTimeout, match=r"the rig's program gave no answer within 0\.2 s"):
        asyncio.run(query(PYTHON, ["import time; time.sleep(600)"], patience_s=0.2))


@pytest.mark.slow
def test_a_cancelled_program_stops_the_rig(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It gets SIGTERM, and the time to act on it."""
    monkeypatch.setattr(access, "_END_S", 120.0)  # a busy machine may take longer than it is given
    program = f"""
import pathlib, signal, sys, time
folder = pathlib.Path({str(tmp_path)!r})
signal.signal(signal.SIGTERM, lambda *_: (folder.joinpath("stopped").touch(), sys.exit()))
folder.joinpath("runs").touch()
time.sleep(600)
"""

    async def scene() -> None:
        task = asyncio.ensure_future(query(PYTHON, [program]))
        while not (tmp_path / "runs").exists():
            await asyncio.sleep(0.01)
        task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await task

    asyncio.run(scene())
    assert (tmp_path / "stopped").exists()


def test_signals_end_the_command_between_two_queries(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As while a person reads a ruler."""
    monkeypatch.setenv("DODO_LEASES", str(tmp_path))
    with occupied(121, "'dodo rig measure'", [], print, 1.0) as ask:
        assert ask((PYTHON, ["print({})"])) == ask((PYTHON, ["print({})"])) == {}
        assert signal.getsignal(signal.SIGTERM) == signal.getsignal(signal.SIGHUP) == signal.SIG_DFL
