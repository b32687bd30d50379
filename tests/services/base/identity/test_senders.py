"""Who may send what, as the compiler writes it, and the reason of a test in which the application did."""

import json
from pathlib import Path

import pytest

from dodo_dsl.opendlv import address_book
from dodo_dsl.opendlv.address import CHANNEL_VARIABLE
from dodo_dsl.opendlv.envelope import Envelope
from dodo_dsl.opendlv.message_set import MessageSet
from services.base.members import VARIABLE, Producers, SenderTable

MESSAGES = MessageSet.standard()


def loaded(monkeypatch: pytest.MonkeyPatch, text: str) -> SenderTable:
    monkeypatch.setenv(VARIABLE, text)
    return SenderTable.load(MESSAGES)


def of(name: str, stamp: int) -> Envelope:
    return Envelope(MESSAGES.id(name), b"", 0, 0, 0, stamp)


def test_by_message_and_sender_stamp(monkeypatch: pytest.MonkeyPatch) -> None:
    table = loaded(monkeypatch, "opendlv.sim.Frame/3=pose,way? opendlv.sim.Command=")
    assert table.producers(of("opendlv.sim.Frame", 3)) == Producers(
        "opendlv.sim.Frame/3", ("pose", "way"), frozenset(["way"])
    )
    assert table.producers(of("opendlv.sim.Frame", 0)) is None
    assert table.producers(of("opendlv.sim.Command", 99)) == Producers("opendlv.sim.Command")


@pytest.mark.parametrize(
    ("services", "who"),
    [
        ((), "no service of this test sends"),
        (("pose",), "only 'pose' may send"),
        (("a", "b"), "only 'a' and 'b' may send"),
        (("a", "b", "c"), "only 'a', 'b' and 'c' may send"),
        (("a", "b", "c", "d"), "only services of the test may send"),
    ],
)
def test_the_reason(services: tuple[str, ...], who: str) -> None:
    assert Producers("opendlv.sim.Frame/0", services).reason == f"the application sent opendlv.sim.Frame/0, which {who}"


def test_the_runner_is_known_by_its_address(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    runner, other = ("10.0.0.1", 40_000), ("10.0.0.1", 40_001)
    monkeypatch.setenv(CHANNEL_VARIABLE, str(tmp_path))
    table, begin = loaded(monkeypatch, ""), of("dodo.TestBegin", 0)
    address_book.enter(tmp_path, "dodo-runner", runner)
    assert table.is_of_runner(of("opendlv.sim.Frame", 0), other)
    assert table.is_of_runner(begin, runner)
    assert not table.is_of_runner(begin, other)
    (line,) = capsys.readouterr().out.splitlines()
    reason = "the application sent dodo.TestBegin, which only the runner may send"
    assert json.loads(line) == {"dodo": "foreign", "reason": reason}
    assert not table.is_of_runner(of("dodo.Alive", 0), runner), "signs of life have an address of their own"


@pytest.mark.parametrize("text", ["opendlv.sim.Frame/x=pose", "opendlv.sim.Fram/0=pose"])
def test_words_that_make_no_table(monkeypatch: pytest.MonkeyPatch, text: str) -> None:
    with pytest.raises(ValueError, match=r"Fram"):
        loaded(monkeypatch, text)
