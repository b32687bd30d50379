"""The log on the bus, heard by another session."""

import logging
from collections.abc import Iterator

import pytest

from dodo_dsl.opendlv.session import Session
from services.base.process import LONGEST, published
from tests.services.base.conftest import Start
from tests.services.process import receive

LOG = "opendlv.system.LogMessage"
END = "the end of this test"


@pytest.fixture
def sessions(cid: int) -> Iterator[tuple[Session, Session]]:
    with Session(cid) as ours, Session(cid) as theirs:
        yield ours, theirs


def heard(session: Session, sender_stamp: int = 3) -> list[tuple[int, str]]:
    """Severities and texts up to the last line."""
    lines = []
    while not lines or lines[-1][1] != END:
        message = receive(session, LOG, sender_stamp)[1]
        lines.append((message.level, message.description))
    return lines[:-1]


def test_each_line_with_its_severity(sessions: tuple[Session, Session]) -> None:
    ours, theirs = sessions
    log = logging.getLogger("published")
    log.setLevel(logging.DEBUG)
    with published(ours, 3):
        log.debug("a %s", "detail")
        log.info("a fact")
        log.warning("odd\nthing")
        log.error("x" * 2 * LONGEST)
        log.warning(END)
    log.warning("nobody is told of this")
    assert heard(theirs) == [(7, "a detail"), (6, "a fact"), (4, "odd thing"), (3, "x" * LONGEST)]
    assert theirs.receive(0.0) is None


def test_the_error_that_ends_it(sessions: tuple[Session, Session]) -> None:
    ours, theirs = sessions
    with pytest.raises(ValueError, match="lost"), published(ours, 0):
        raise ValueError("the rig is lost")
    message = receive(theirs, LOG)[1]
    assert (message.level, message.description) == (2, "the rig is lost")


def test_a_service_says_on_the_bus_what_it_logs_where_it_is_asked_to(start: Start, cid: int) -> None:
    with Session(cid) as session:
        assert start("--role=broken").end()[0] == 1
        service = start("--role=broken", "--log-id=9")
        message = receive(session, LOG, 9)[1]
        assert (message.level, message.description) == (2, "a model went wrong")
        assert service.end()[0] == 1
        assert session.receive(0.0) is None
