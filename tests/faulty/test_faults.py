"""Every fault changes what the application says, and only that; the wrapper without a fault changes nothing."""

import subprocess
import sys
import time
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from dodo_dsl.opendlv.envelope import Envelope
from dodo_dsl.opendlv.message_set import MessageSet
from tests.faulty import of_conduct
from tests.faulty.kiwi import PERCEPTION, STEERING, Make, program
from tests.faulty.makes import MAKES, NAMES, fault_of
from tests.faulty.of_ranges import RANGE_FAULTS
from tests.faulty.page import GAPS
from tests.faulty.table import FAULTS, RANGES

WIDTH, HEIGHT, CID = 160, 120, 200
FRAMES = 70
BEGIN, PERIOD = 1_700_000_000_000_000, 100_000  # us
GREY, YELLOW, BLUE = (104, 104, 104, 255), (0, 217, 255, 255), (230, 38, 0, 255)
IN_TIME = {"slow-computing", "slow-sleeping", "leaks"}
"""They say the same, only later or with more memory."""
BY_THE_CLOCK = {"steering-wall-clock", "sample-time-now"}

Saying = tuple[Any, ...]


class Recorder:
    """A session that keeps what is sent."""

    def __init__(self, cid: int) -> None:
        self.cid, self.messages = cid, MessageSet.standard()
        self.said: list[Saying] = []
        self.envelopes: list[Envelope] = []

    def send(self, message: Any, sample_time: int | None = None, sender_stamp: int = 0) -> bytes:
        sampled = time.time_ns() // 1000 if sample_time is None else sample_time
        self.said.append((self.cid, message.DESCRIPTOR.full_name, str(message), sampled, sender_stamp))
        id_, payload = self.messages.id(message), self.messages.encode(message)
        self.envelopes.append(Envelope(id_, payload, 0, 0, sampled, sender_stamp))
        return b""


def picture(number: int) -> Any:
    """A yellow and a blue cone that move, a small one behind the yellow one; nothing in the last picture."""
    image = np.full((HEIGHT, WIDTH, 4), GREY, np.uint8)
    if number == FRAMES - 1:
        return image
    for colour, x, y, height in ((YELLOW, 20, 70, 20), (BLUE, 130, 80, 24), (YELLOW, 50, 60, 6)):
        left = x - (number * 7) % 20
        image[y : y + height, left : left + height // 2] = colour
    return image


@cache
def seen(make: Make | None) -> Recorder:
    """What perception sends, with a fault."""
    module = program(PERCEPTION)
    module.Session = Recorder
    if make:
        make(module)
    session: Recorder = module.Session(CID)
    source = SimpleNamespace(name="video0.argb", width=WIDTH, height=HEIGHT)
    with noted(session):
        for number in range(FRAMES):
            cones = module.find(picture(number))
            module.announce(session, cones, number, BEGIN + number * PERIOD, source)
    return session


@cache
def driven(make: Make | None) -> Recorder:
    """What steering sends on the example's perception, with a fault."""
    module = program(STEERING)
    module.Session = Recorder
    if make:
        make(module)
    session: Recorder = module.Session(CID)
    frames, driver = module.Frames(), module.Driver()
    heard = {session.messages.id(name) for name in module.HEARD}
    with noted(session):
        for envelope in (each for each in seen(None).envelopes if each.data_type in heard):
            module.handle(session, envelope, frames, driver, False)
    return session


class noted:
    """How a program ends is part of what it says."""

    def __init__(self, session: Recorder) -> None:
        self._session = session

    def __enter__(self) -> None: ...

    def __exit__(self, _kind: object, problem: BaseException | None, _place: object) -> bool:
        if isinstance(problem, SystemExit | RuntimeError):
            self._session.said.append(("ended", repr(problem)))
            return True
        return False


def said(name: str, make: Make | None) -> list[Saying]:
    return {PERCEPTION: seen, STEERING: driven}[name](make).said


CASES = [(name, fault) for name, faults in MAKES.items() for fault in faults if fault not in IN_TIME]


def test_the_table_is_complete_and_names_real_tests() -> None:
    assert set(FAULTS) == set(NAMES) and set(RANGES) == set(RANGE_FAULTS)
    assert len(FAULTS) >= 40
    for fault in FAULTS.values():
        folder = fault.test.partition("--")[0]
        assert (Path(__file__).parents[2] / "tests_registry" / folder / f"{folder}.dodo.yml").is_file(), fault
    kinds = {fault.kind for fault in FAULTS.values()}
    assert {name for reasons in GAPS.values() for name in reasons} <= kinds | set(FAULTS)


@pytest.mark.parametrize("name", MAKES)
def test_the_example_says_a_lot(name: str) -> None:
    assert len(said(name, None)) >= 2 * FRAMES


@pytest.mark.thorough
@pytest.mark.parametrize(("name", "fault"), CASES)
def test_a_fault_changes_what_a_program_says(name: str, fault: str) -> None:
    make = MAKES[name][fault]
    if fault == "crashes-at-start":
        module = program(name)
        make(module)
        with pytest.raises(RuntimeError, match="has a fault"):
            module.main()
        return
    assert said(name, make) != said(name, None)


@pytest.mark.thorough
@pytest.mark.parametrize(("name", "fault"), [case for case in CASES if case[1] not in BY_THE_CLOCK])
def test_a_fault_is_the_same_every_time(name: str, fault: str) -> None:
    make = MAKES[name][fault]
    first = said(name, make)
    {PERCEPTION: seen, STEERING: driven}[name].cache_clear()
    assert said(name, make) == first


@pytest.mark.parametrize("fault", sorted(IN_TIME))
def test_a_slow_or_greedy_application_says_the_same(fault: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(of_conduct, "LEAK_BYTES", 10)
    slow = {
        "slow-computing": of_conduct.each_frame(of_conduct.computing(0.0001)),
        "slow-sleeping": of_conduct.each_frame(of_conduct.sleeping(0.0001)),
        "leaks": MAKES[PERCEPTION]["leaks"],
    }[fault]
    assert said(PERCEPTION, slow) == said(PERCEPTION, None)


def test_computing_takes_processor_time_and_sleeping_takes_none() -> None:
    began = time.process_time()
    of_conduct.computing(0.02)()
    computed = time.process_time()
    of_conduct.sleeping(0.02)()
    assert computed - began >= 0.02 > time.process_time() - computed


def test_a_fault_belongs_to_a_bus_where_the_flag_says_so() -> None:
    both = "128=steering-nan,130=silent"
    assert [fault_of(both, cid) for cid in ("128", "129", "130")] == ["steering-nan", "none", "silent"]
    assert fault_of("steering-nan", "129") == "steering-nan"


@pytest.mark.thorough
def test_the_program_refuses_an_unknown_fault() -> None:
    words = [
        sys.executable,
        str(Path(__file__).with_name("program.py")),
        STEERING,
        "--fault=steering-revered",
        "--cid=1",
    ]
    result = subprocess.run(words, capture_output=True, text=True, check=False)
    assert result.returncode == 2
    assert "'steering-revered' is not a fault" in result.stderr
