"""One who looks at everything sees each message of a lockstep test once, in the step that it belongs to."""

from dodo_dsl.opendlv.envelope import Envelope
from services.base.lockstep_clock import EPOCH, Observer

STEP = 100_000


class Seen:
    """An inbox that remembers."""

    observes = True
    consumes: frozenset[int] = frozenset()

    def __init__(self) -> None:
        self.seen: list[tuple[bytes, int]] = []

    def observe(self, envelope: Envelope) -> None:
        self.seen.append((envelope.payload, envelope.sample_time))

    def handle(self, envelope: Envelope) -> None:
        raise AssertionError

    def receive(self, timeout: float) -> Envelope | None:
        raise AssertionError


def sent(payload: bytes, time: int, received: int = 0) -> Envelope:
    return Envelope(1003, payload, 5, received, time, 0)


def test_copies_on_the_bus_count_once_however_late_they_are() -> None:
    observer, inbox = Observer(), Seen()
    observer.collect(sent(b"a", EPOCH, 9))
    observer.deliver(inbox, EPOCH, [sent(b"a", EPOCH), sent(b"b", EPOCH)])
    observer.collect(sent(b"b", EPOCH, 9))
    observer.deliver(inbox, EPOCH + STEP, [])
    assert inbox.seen == [(b"a", EPOCH), (b"b", EPOCH)]


def test_what_was_lost_on_the_bus_is_seen_all_the_same() -> None:
    observer, inbox = Observer(), Seen()
    observer.deliver(inbox, EPOCH, [sent(b"a", EPOCH)])
    assert inbox.seen == [(b"a", EPOCH)]


def test_the_application_counts_as_it_is_on_the_bus_and_not_as_it_is_handed_on() -> None:
    observer, inbox = Observer(), Seen()
    observer.collect(sent(b"own time", 77, 9))
    observer.deliver(inbox, EPOCH, [sent(b"own time", EPOCH, 9)])
    assert inbox.seen == [(b"own time", 77)]


def test_a_later_step_s_message_waits_for_that() -> None:
    observer, inbox = Observer(), Seen()
    observer.collect(sent(b"early", EPOCH + STEP, 9))
    observer.deliver(inbox, EPOCH, [])
    assert inbox.seen == []
    observer.deliver(inbox, EPOCH + STEP, [])
    assert inbox.seen == []
    observer.deliver(inbox, EPOCH + 2 * STEP, [])
    assert inbox.seen == [(b"early", EPOCH + STEP)]


def test_an_answer_stands_before_the_next_step_whenever_it_came() -> None:
    orders = []
    for is_swift in (True, False):
        observer, inbox = Observer(), Seen()
        answer = sent(b"answer", EPOCH, 9)
        if is_swift:
            observer.collect(answer)
        observer.deliver(inbox, EPOCH, [sent(b"0", EPOCH)])
        if not is_swift:
            observer.collect(answer)
        observer.deliver(inbox, EPOCH + STEP, [sent(b"1", EPOCH + STEP)])
        orders.append([payload for payload, _ in inbox.seen])
    assert orders == [[b"0", b"answer", b"1"]] * 2


def test_the_last_answer_is_seen_at_the_end_of_the_test() -> None:
    observer, inbox = Observer(), Seen()
    observer.deliver(inbox, EPOCH, [sent(b"own", EPOCH)])
    for payload in (b"own", b"answer"):
        observer.collect(sent(payload, EPOCH, 9))
    observer.flush(inbox)
    observer.flush(inbox)
    assert [payload for payload, _ in inbox.seen] == [b"own", b"answer"]


def test_the_first_messages_said_again_much_later() -> None:
    observer, inbox = Observer(), Seen()
    observer.deliver(inbox, EPOCH, [sent(b"a", EPOCH)])
    for step in range(1, 200):
        observer.deliver(inbox, EPOCH + step * STEP, [])
    observer.collect(sent(b"a", EPOCH, 9))
    observer.deliver(inbox, EPOCH + 200 * STEP, [])
    assert inbox.seen == [(b"a", EPOCH)]


def test_what_services_sent_long_ago_is_forgotten() -> None:
    """Fifty steps later a copy counts, unless a service sent the same again meanwhile; none is that late."""
    observer, inbox = Observer(), Seen()
    observer.deliver(inbox, EPOCH, [sent(b"first", EPOCH)])
    for step in range(1, 53):
        again = [sent(b"again", 88)] if step in (1, 40) else []
        observer.deliver(inbox, EPOCH + step * STEP, [sent(b"once", 77), *again] if step == 1 else again)
    inbox.seen.clear()
    for payload, time in ((b"once", 77), (b"again", 88), (b"first", EPOCH)):
        observer.collect(sent(payload, time, 9))
    observer.deliver(inbox, EPOCH + 53 * STEP, [])
    assert inbox.seen == [(b"once", 77)]
