import shutil
import socket
import subprocess
import sys
import time
from collections.abc import Iterator

import pytest

from dodo_dsl.opendlv import session as sessions
from dodo_dsl.opendlv.address import group
from dodo_dsl.opendlv.envelope import Envelope, decode_frame, encode_frame
from dodo_dsl.opendlv.message_set import MessageSet
from dodo_dsl.opendlv.session import MAX_DATAGRAM_BYTES, Session, SessionError
from tests.opendlv.conftest import Peer

STANDARD = MessageSet.standard()
STEERING = STANDARD.type("opendlv.proxy.GroundSteeringRequest")
IMAGE = STANDARD.type("opendlv.proxy.ImageReading")
SIZE_OF_EMPTY_IMAGE_FRAME = 60  # bytes, an upper bound


def now() -> int:
    return time.time_ns() // 1000


def test_libcluon_receives_what_is_sent(cid: int, peer: Peer) -> None:
    before = now()
    with Session(cid) as session:
        session.send(STEERING(groundSteering=-0.25), sample_time=1_715_000_000_123_456, sender_stamp=7)
        session.send(STEERING())
        sampled, plain = peer.answer(), peer.answer()
    assert (sampled["id"], sampled["payload"], sampled["stamp"]) == (1090, "0d000080be", 7)
    assert sampled["sampled"] == 1_715_000_000_123_456
    assert before <= sampled["sent"] <= sampled["received"] <= now()
    assert plain["sampled"] == plain["sent"]


def test_what_libcluon_sends_is_received(cid: int, peer: Peer) -> None:
    before = now()
    with Session(cid) as session:
        peer.order("send", id=1090, payload="0d000080be", sent=5_000_001, sampled=-1_000_001, stamp=2**32 - 1)
        envelope = session.receive(10.0)
    assert envelope is not None
    assert envelope == Envelope(1090, bytes.fromhex("0d000080be"), 5_000_001, envelope.received, -1_000_001, 2**32 - 1)
    assert before <= envelope.received <= now()
    assert session.messages.decode(1090, envelope.payload).groundSteering == -0.25


def test_frames_are_those_of_libcluon_byte_for_byte(cid: int, peer: Peer) -> None:
    bus = group(cid)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as listener:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.bind(bus)
        listener.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, socket.inet_aton(bus[0]) + bytes(4))
        listener.settimeout(10.0)
        for id_, payload, sent, sampled, stamp in [
            (1090, "0d000080be", 1_715_000_000_123_456, 1_715_000_000_000_000, 0),
            (0, "", 0, 0, 0),
            (2**31 - 1, "00" * 200, 2**31 * 1_000_000 - 1, -1, 2**32 - 1),
            (64, "ff" * 127, 63, -64_000_000, 127),
            (63, "ff" * 128, 64, -1_999_999, 128),
        ]:
            peer.order("send", id=id_, payload=payload, sent=sent, sampled=sampled, stamp=stamp)
            frame = listener.recv(MAX_DATAGRAM_BYTES)
            envelope = Envelope(id_, bytes.fromhex(payload), sent, 0, sampled, stamp)
            assert frame == encode_frame(envelope)
            assert decode_frame(frame) == envelope


def test_own_messages_are_dropped_and_others_kept_in_order(cid: int) -> None:
    with Session(cid) as one, Session(cid) as other:
        for stamp in range(50):
            one.send(STEERING(), sender_stamp=stamp)
            other.send(STEERING(), sender_stamp=1000 + stamp)
        heard = [one.receive(5.0) for _ in range(50)]
        assert [envelope.sender_stamp for envelope in heard if envelope] == list(range(1000, 1050))
        assert one.receive(0.0) is None


def test_garbage_is_counted(cid: int) -> None:
    with Session(cid) as session, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
        for data in (b"", b"hello", b"\x0d\xa4\x05\x00\x00\xff", b"\x0d\xa4\x02\x00\x00\x08\x02"):
            stranger.sendto(data, group(cid))
        envelope = session.receive(5.0)
        assert envelope is not None and envelope.data_type == 1
        assert session.garbage == 3


def test_messages_without_room_in_the_buffer_are_counted(cid: int, monkeypatch: pytest.MonkeyPatch) -> None:
    with Session(cid) as sender:
        monkeypatch.setattr(sessions, "RECEIVE_BUFFER", 8192)
        with Session(cid) as session:
            for stamp in range(200):
                sender.send(STEERING(), sender_stamp=stamp)
            heard = []
            while (envelope := session.receive(0.0)) is not None:
                heard.append(envelope.sender_stamp)
            assert heard == list(range(len(heard))) and session.lost == 0
            sender.send(STEERING(), sender_stamp=200)
            assert session.receive(5.0) is not None
            assert session.lost == 200 - len(heard) > 0


IDS = [0, 5, 63, 64, 1090, 8191, 8192, 1_048_575, 1_048_576, 2**31 - 1, -1, -64, -65, -(2**31)]


@pytest.mark.parametrize("is_kernel_able", [True, False])
@pytest.mark.thorough
def test_only_some_messages_are_heard(cid: int, is_kernel_able: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    if not is_kernel_able:
        monkeypatch.setattr(sessions, "attach_filter", lambda *_: False)
    for chosen in ([], [1090], IDS[::2], IDS[1::2], range(300)):
        with Session(cid) as session, Session(cid) as other:
            session.hear_only(chosen)
            for id_ in IDS:
                other.send_envelope(Envelope(id_, b"x", 0, 0, 0, 0))
            heard = []
            while (envelope := session.receive(0.05)) is not None:
                heard.append(envelope.data_type)
            assert heard == [id_ for id_ in IDS if id_ in chosen]
            assert session.lost == 0


def test_the_largest_datagram_passes_and_a_larger_one_is_refused(cid: int) -> None:
    with Session(cid) as one, Session(cid) as other:
        one.send(IMAGE(data=bytes(MAX_DATAGRAM_BYTES - SIZE_OF_EMPTY_IMAGE_FRAME)))
        envelope = other.receive(5.0)
        assert envelope is not None and len(envelope.payload) > 65_000
        with pytest.raises(SessionError, match=r"message 1055 needs 655\d\d bytes of 65507 in a datagram"):
            one.send(IMAGE(data=bytes(MAX_DATAGRAM_BYTES)))


def test_messages_gather_behind_one_that_came(cid: int, monkeypatch: pytest.MonkeyPatch) -> None:
    slept: list[float] = []
    with Session(cid) as session, Session(cid) as other:
        monkeypatch.setattr(time, "sleep", lambda seconds: (slept.append(seconds), other.send(STEERING())))
        session.gather(0.05)
        other.send(STEERING())
        assert session.receive(5.0) is not None and slept == []
        assert session.receive(5.0) is not None and slept == [0.05]


def test_a_machine_without_a_route_for_multicast() -> None:
    alone = ["unshare", "--net", "--map-root-user"]
    if shutil.which("unshare") is None or subprocess.run([*alone, "true"], check=False, capture_output=True).returncode:
        pytest.skip("no network namespace can be made here")
    code = "from dodo_dsl.opendlv.session import Session\ntry: Session(130)\nexcept OSError as error: print(error)"
    done = subprocess.run([*alone, sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.startswith("the bus 225.0.0.130:12175 cannot be joined: ")
    assert done.stdout.endswith(" (is there a route to 224.0.0.0/4?)\n")


def test_nobody_has_a_session_s_port_at_another_local_address(cid: int) -> None:
    """Its address could else be put into datagrams."""
    with Session(cid) as session, socket.socket(type=socket.SOCK_DGRAM) as other:
        other.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        with pytest.raises(OSError, match="Address already in use"):
            other.bind(("127.0.0.2", session.port))


@pytest.mark.thorough
def test_what_is_sent_directly_only_one_hears_in_the_order_of_arrival(cid: int) -> None:
    with Session(cid) as sender, Session(cid) as hearer, Session(cid) as other:
        for session in (hearer, other):
            session.hear_directly()
        for number in range(6):
            envelope = Envelope(1, b"", number, 0, 0, 0)
            if number % 2:
                sender.send_directly(envelope, [hearer.address])
            else:
                sender.send_envelope(envelope)
        heard = [(e.sent, hearer.was_direct, hearer.source == sender.address) for e in drained(hearer)]
        assert heard == [(number, number % 2 == 1, True) for number in range(6)]
        assert [e.sent for e in drained(other)] == [0, 2, 4]
        hearer.hear_directly(False)
        sender.send_directly(Envelope(1, b"", 7, 0, 0, 0), [hearer.address])
        sender.send_envelope(Envelope(1, b"", 8, 0, 0, 0))
        assert [e.sent for e in drained(hearer)] == [8]


def drained(session: Session) -> Iterator[Envelope]:
    while (envelope := session.receive(0.2)) is not None:
        yield envelope
