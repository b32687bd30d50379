"""What the runner sends to a session of this machine, and where it announces the begin of a test."""

import io
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import pytest

from dodo_dsl.opendlv import address_book
from dodo_dsl.opendlv.address_book import AddressBook
from dodo_dsl.opendlv.relay import Relay, serve
from dodo_dsl.opendlv.session import Session
from dodo_dsl.plan.model import Lockstep
from dodo_dsl.run.announce import begin_frame, hearers
from tests.run.scripted import plan


def test_the_begin_goes_to_services_alone_but_where_the_application_is_told() -> None:
    test = plan()
    names = [service.name for service in test.services]
    assert hearers(test) == names
    assert hearers(replace(test, told=("dodo.TestBegin",))) == [*names, "*"]
    assert hearers(replace(test, lockstep=Lockstep(1, 60.0))) == ["dodo-clock"]


@pytest.mark.parametrize("known", [True, False])
def test_who_does_not_say_its_address_hears_on_the_bus(known: bool, cid: int, tmp_path: Path) -> None:
    with Session(cid) as track, Session(cid) as application:
        track.hear_directly()
        if known:
            address_book.enter(tmp_path, "track", track.address)
        with closing(Relay(cid, tmp_path)) as relay:
            serve(relay, io.StringIO(f"track {begin_frame(7).hex()}\n"), io.StringIO())
        book = AddressBook(tmp_path)
        for session, hears in ((track, True), (application, not known)):
            envelope = session.receive(0.2)
            assert (envelope is not None) == hears
            if envelope:
                assert book.knows(session.source, envelope.received)
