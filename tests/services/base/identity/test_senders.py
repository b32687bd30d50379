"""Who may send what, as the compiler writes it, and the reason of a test in which the application did."""

import json

import pytest

from dodo_dsl.opendlv.authentication import with_proof
from dodo_dsl.opendlv.envelope import Envelope
from dodo_dsl.opendlv.message_set import MessageSet
from services.base.members import VARIABLE, Producers, SenderTable

MESSAGES = MessageSet.standard()


def loaded(monkeypatch: pytest.MonkeyPatch, text: str) -> SenderTable:
    monkeypatch.setenv(VARIABLE, text)
    return SenderTable.load(MESSAGES, b"key")


def of(name: str, stamp: int, payload: bytes = b"") -> Envelope:
    return Envelope(MESSAGES.id(name), payload, 0, 0, 0, stamp)


def test_by_message_and_sender_stamp(monkeypatch: pytest.MonkeyPatch) -> None:
    table = loaded(monkeypatch, "opendlv.sim.Frame/3=pose,way? opendlv.sim.Command=")
    assert table.producers(of("opendlv.sim.Frame", 3)) == Producers(
        "opendlv.sim.Frame/3", ("pose", "way"), frozenset(["way"])
    )
    assert table.producers(of("opendlv.sim.Frame", 0)) is None
    assert table.producers(of("opendlv.sim.Command", 99)) == Producers("opendlv.sim.Command")
    assert table.services == {"pose", "way"}


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


def test_the_runner_proves_what_it_sends(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    table = loaded(monkeypatch, "")
    id_ = MESSAGES.id("dodo.TestBegin")
    assert table.is_of_runner(of("opendlv.sim.Frame", 0))
    assert table.is_of_runner(of("dodo.TestBegin", 0, with_proof(b"key", id_, b"")))
    assert not table.is_of_runner(of("dodo.TestBegin", 0))
    assert not table.is_of_runner(of("dodo.TestBegin", 0, with_proof(b"other", id_, b"")))
    (line,) = capsys.readouterr().out.splitlines()
    reason = "the application sent dodo.TestBegin, which only the runner may send"
    assert json.loads(line) == {"dodo": "foreign", "reason": reason}


@pytest.mark.parametrize("text", ["opendlv.sim.Frame/x=pose", "opendlv.sim.Fram/0=pose"])
def test_words_that_make_no_table(monkeypatch: pytest.MonkeyPatch, text: str) -> None:
    with pytest.raises(ValueError, match=r"Fram"):
        loaded(monkeypatch, text)
