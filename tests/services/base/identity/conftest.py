"""Services of a test that know each other's addresses."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from dodo_dsl.opendlv import address_book
from dodo_dsl.opendlv.address import CHANNEL_VARIABLE
from dodo_dsl.opendlv.session import Session
from services.base.members import Members, SenderTable, World

Join = Callable[..., tuple[Session, Members]]


@pytest.fixture
def enter(cid: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Join]:
    """Makes a service with its session, which the others know if it ``says`` where it is."""
    monkeypatch.setenv(CHANNEL_VARIABLE, str(tmp_path))
    with ExitStack() as stack:

        def one(name: str, says: bool = True) -> tuple[Session, Members]:
            session = stack.enter_context(Session(cid))
            session.hear_directly()
            if says:
                address_book.enter(tmp_path, name, session.address)
            return session, Members(session, name, SenderTable(session.messages), World(session.messages))

        yield one
