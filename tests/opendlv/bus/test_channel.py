"""Services connect once, each by its name; what they say arrives whole and in order."""

import socket
import threading
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

from dodo_dsl.opendlv.channel import Channel, Done, Step
from dodo_dsl.opendlv.envelope import Envelope
from dodo_dsl.opendlv.packets import PACKET, Listener


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "clock"


@pytest.fixture
def listener(path: Path) -> Iterator[Listener]:
    with closing(Listener(path, {"pose", "track"})) as listener:
        yield listener


def accepted(listener: Listener, *names: str) -> dict[str, Channel]:
    found: dict[str, Channel] = {}
    while set(found) != {*names}:
        if accepted := listener.accept(5.0):
            found[accepted[0]] = Channel(accepted[1])
    return found


def test_who_is_none_of_the_services_or_comes_twice_is_turned_away(path: Path, listener: Listener) -> None:
    with closing(Channel.connect(path, "pose")) as pose, closing(Channel.connect(path, "nobody")) as nobody:
        ours = accepted(listener, "pose")
        with (
            socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as other,
            closing(Channel.connect(path, "pose")) as again,
        ):
            other.connect(str(path))
            other.send(b"\0not a message")
            with closing(Channel.connect(path, "track")) as track:
                ours |= accepted(listener, "track")
                for stranger in (nobody, again):
                    with pytest.raises(EOFError):
                        stranger.receive(5.0)
                assert other.recv(1) == b""
                assert not (listener.missing or path.exists()), "all are there"
                for name, service in (("pose", pose), ("track", track)):
                    service.send(Done(name, []))
                    assert ours[name].receive(5.0) == Done(name, [])
                    ours[name].close()
                    with pytest.raises(EOFError):
                        service.receive(5.0)
                    service.send(Done(name, []))  # lost


@pytest.mark.parametrize("size", [0, PACKET - 20, PACKET, 10 * PACKET + 7])
def test_messages_of_any_size(size: int, path: Path) -> None:
    step = Step(7, [Envelope(1090, b"x" * size, -1, 0, 2**50, 2**32 - 1), Envelope(1, b"", 0, 0, 0, 0)])
    with closing(Listener(path, {"pose"})) as listener, closing(Channel.connect(path, "pose")) as pose:
        clock = accepted(listener, "pose")["pose"]
        thread = threading.Thread(target=lambda: [clock.send(step) for _ in range(2)])
        thread.start()
        assert [pose.receive(5.0) for _ in range(2)] == [step, step]
        thread.join()
        assert pose.receive(0.0) is None
        clock.close()


def test_a_socket_that_was_left_is_replaced_and_the_clock_awaited(path: Path) -> None:
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as left:
        left.bind(str(path))
    found: list[Channel] = []
    thread = threading.Thread(target=lambda: found.append(Channel.connect(path, "pose")))
    thread.start()
    with closing(Listener(path, {"pose"})) as listener:
        accepted(listener, "pose")["pose"].close()
    thread.join()
    found[0].close()
