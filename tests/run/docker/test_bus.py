"""The begin of a test, announced through its sandbox container or on the host."""

import asyncio

import pytest

from dodo_dsl.opendlv.address import group
from dodo_dsl.opendlv.envelope import decode_frame
from dodo_dsl.opendlv.session import Session
from dodo_dsl.run.docker.events import announce_begin
from dodo_dsl.run.protocol import BackendError


class Sandbox:
    """A container that remembers a command, and ends it with a code and an output."""

    def __init__(self, code: int, output: bytes | None) -> None:
        self.answer = (code, output)
        self.words: list[str] = []

    def exec_run(self, words: list[str]) -> tuple[int, bytes | None]:
        self.words = words
        return self.answer


def test_it_is_received_on_the_host(cid: int) -> None:
    with Session(cid) as session:
        asyncio.run(announce_begin(7, [group(cid)], None))
        envelope = session.receive(5.0)
    assert envelope is not None
    assert session.messages.decode(envelope.data_type, envelope.payload).seed == 7  # type: ignore[attr-defined]


def test_the_sandbox_sends_the_datagram_to_each_service() -> None:
    sandbox = Sandbox(0, b"")
    asyncio.run(announce_begin(7, [("10.1.0.2", 40000), ("10.1.0.3", 40001)], sandbox))
    *_, escaped, first, second = sandbox.words
    assert (first, second) == ("10.1.0.2/40000", "10.1.0.3/40001")
    assert decode_frame(bytes.fromhex(escaped.replace("\\x", ""))).data_type > 0


@pytest.mark.parametrize(
    ("sandbox", "to", "problem"),
    [
        (Sandbox(1, b"no such file\n"), group(140), "no such file$"),
        (Sandbox(1, None), group(140), "exit code 1$"),
        (None, ("225.0.0.999", 1), ""),
    ],
)
def test_what_is_not_sent_is_an_error(sandbox: Sandbox | None, to: tuple[str, int], problem: str) -> None:
    with pytest.raises(BackendError, match=f"cannot be announced to its services: {problem}"):
        asyncio.run(announce_begin(7, [to], sandbox))
