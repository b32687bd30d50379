"""Services find each other by a folder, whatever else lies there, and what is sent after a service left is not its."""

import socket
import time
from pathlib import Path

from dodo_dsl.opendlv import address_book
from dodo_dsl.opendlv.address_book import AddressBook

POSE, TRACK = ("10.0.0.1", 40_000), ("10.0.0.2", 40_001)


def test_each_change_is_seen(tmp_path: Path) -> None:
    book = AddressBook(tmp_path)
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as clock:
        clock.bind(str(tmp_path / ".clock"))
    (tmp_path / "other").symlink_to("nowhere")
    for number in range(200):  # more often than the clock of a file system ticks
        address_book.enter(tmp_path, "pose", (POSE[0], number + 1))
        book.read()
        assert book.addresses == {"pose": (POSE[0], number + 1)}
    address_book.remove(tmp_path, "pose")
    assert not book.knows((POSE[0], 200), 0)


def test_what_a_service_sent_before_it_left_counts(tmp_path: Path) -> None:
    book = AddressBook(tmp_path)
    for name, address in (("pose", POSE), ("track", TRACK)):
        address_book.enter(tmp_path, name, address)
    before = time.time_ns() // 1000
    address_book.leave(tmp_path, "pose", POSE)
    after = time.time_ns() // 1000 + 1
    assert [book.knows(POSE, when) for when in (before, after)] == [True, False]
    assert book.knows(TRACK, after)
    assert (book.present, set(book.addresses)) == ({TRACK}, {"pose", "track"})
    address_book.enter(tmp_path, "camera", POSE)
    assert book.knows(POSE, after), "another service has its port"


def test_without_a_folder_nobody_is_known() -> None:
    book = AddressBook(None)
    assert not book.knows(POSE, 0)
