"""When messages of a lockstep test are due."""

from dodo_dsl.opendlv.envelope import Envelope
from services.base.lockstep_clock import EPOCH, LONGEST, in_order


def test_messages_are_due_by_test_time_and_others_behind_what_came_before_them() -> None:
    """The test's begin stays first, however old a recording is whose own times are kept."""
    old, new = EPOCH - 7_000_000, EPOCH + LONGEST + 1
    times = (EPOCH, old, EPOCH + 20, new, EPOCH + 10)
    heard = in_order(Envelope(1, str(number).encode(), 0, 0, time, 0) for number, time in enumerate(times))
    due = [(due - EPOCH, envelope.payload) for due, envelope in heard]
    assert due == [(0, b"0"), (0, b"1"), (10, b"4"), (20, b"2"), (20, b"3")]
