"""What the kernel's filter passes, in the kernel itself."""

import socket
from collections.abc import Iterator

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dodo_dsl.opendlv import session
from dodo_dsl.opendlv.envelope import Envelope, encode_frame

IDS = st.integers(1, 2**31 - 1)


@pytest.fixture(scope="module")
def pair() -> Iterator[tuple[socket.socket, socket.socket]]:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver, socket.socket(type=socket.SOCK_DGRAM) as sender:
        receiver.bind(("127.0.0.1", 0))
        receiver.setblocking(False)
        sender.connect(receiver.getsockname())
        yield receiver, sender


def passed(pair: tuple[socket.socket, socket.socket], data: bytes) -> bool:
    """Loopback delivers or drops before it returns from sending."""
    receiver, sender = pair
    sender.send(data)
    try:
        return receiver.recv(1 << 16) == data
    except BlockingIOError:
        return False


@given(st.sets(IDS, max_size=9), st.lists(IDS, max_size=9))
def test_only_these_ids_pass(pair: tuple[socket.socket, socket.socket], wanted: set[int], others: list[int]) -> None:
    assert session.attach_filter(pair[0], wanted)
    for id_ in [*wanted, *others]:
        assert passed(pair, encode_frame(Envelope(id_, b"payload", 1, 2, 3, 4))) == (id_ in wanted), id_


@pytest.mark.parametrize("data", [b"0123456789012345", b"\x0d\xa4\x03\0\0\x12\x01x\x08\x02"])
def test_what_does_not_begin_with_an_id_passes(pair: tuple[socket.socket, socket.socket], data: bytes) -> None:
    assert session.attach_filter(pair[0], [7])
    assert passed(pair, data)


def test_more_ids_than_a_filter_holds_are_left_to_the_process(pair: tuple[socket.socket, socket.socket]) -> None:
    assert not session.attach_filter(pair[0], range(1, 3000))


@given(st.sets(IDS, max_size=5), st.sets(IDS, max_size=5), st.booleans())
def test_some_pass_only_from_others(
    pair: tuple[socket.socket, socket.socket], ids: set[int], of_others: set[int], is_one: bool
) -> None:
    host, port = pair[1].getsockname()
    than = [("127.0.0.2", port), (host, port + 1 if port < 65_535 else 1)] + ([(host, port)] if is_one else [])
    assert session.attach_filter(pair[0], ids, of_others, than)
    for id_ in ids | of_others:
        assert passed(pair, encode_frame(Envelope(id_, b"", 1, 2, 3, 4))) == (id_ in ids or not is_one), id_
