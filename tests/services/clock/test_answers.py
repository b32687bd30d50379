"""Which of the application's messages answer a frame."""

from typing import cast

import pytest

from dodo_dsl.opendlv.envelope import Envelope
from services.clock.answers import MOST_SURPLUS, AnsweringApplication, MessageFilter
from services.clock.exchange import ApplicationFails, Exchange

STEER, PEDAL, BOX, READY = 1090, 1086, 1134, 1054
FRAME, NEXT, ELSEWHEN = 1_000_000, 1_100_000, 77
LINK = cast(Exchange, None)
REQUIRED = (MessageFilter("steer", STEER), MessageFilter("pedal", PEDAL))


def said(kind: int, time: int, payload: bytes = b"", stamp: int = 0) -> Envelope:
    return Envelope(kind, payload, 0, 0, time, stamp)


def show(answers: AnsweringApplication, *times: int) -> None:
    answers.expect(times)
    answers.seen()


def answering(*envelopes: Envelope, **about: object) -> AnsweringApplication:
    answers = AnsweringApplication(LINK, REQUIRED, **about)  # type: ignore[arg-type]
    show(answers, FRAME)
    for envelope in envelopes:
        answers.take(envelope)
    return answers


def test_complete_when_each_came_once() -> None:
    answers = answering(said(STEER, FRAME))
    assert answers.missing() == "pedal missing"
    answers.take(said(PEDAL, FRAME))
    assert not answers.missing()
    assert [e.data_type for e in answers.collect()] == [STEER, PEDAL]


def test_the_first_after_the_frame_counts_where_sample_times_are_not_copied() -> None:
    answers = answering(said(STEER, ELSEWHEN, b"first"), said(STEER, ELSEWHEN + 9, b"second"), said(PEDAL, ELSEWHEN))
    assert not answers.missing()
    assert [(e.payload, e.sample_time) for e in answers.collect()] == [(b"first", FRAME), (b"", FRAME)]


def test_what_was_said_before_the_frame_was_seen_is_no_answer_to_it() -> None:
    answers = answering(said(STEER, FRAME), said(PEDAL, FRAME), said(STEER, ELSEWHEN, b"late"))
    answers.collect()
    show(answers, NEXT)
    answers.take(said(PEDAL, FRAME, b"late, too"))
    assert answers.missing() == "steer and pedal missing"


def test_an_answer_with_its_frames_sample_time_counts_however_early_it_is_heard() -> None:
    answers = answering()
    answers.expect([NEXT])
    answers.take(said(STEER, NEXT, b"swift"))
    answers.take(said(PEDAL, ELSEWHEN, b"maybe to the frame before"))
    answers.seen()
    assert answers.missing() == "pedal missing"
    answers.take(said(PEDAL, ELSEWHEN, b"to this one"))
    assert [e.payload for e in answers.collect()] == [b"swift", b"to this one"]


def test_done_ends_the_answer_whatever_came() -> None:
    answers = answering(said(STEER, FRAME), done=MessageFilter("ready", READY, 2))
    answers.take(said(READY, FRAME, stamp=1))
    assert answers.missing() == "ready missing"
    answers.take(said(READY, FRAME, stamp=2))
    assert not answers.missing()
    assert [e.data_type for e in answers.collect()] == [STEER]
    show(answers, NEXT)
    answers.take(said(READY, FRAME, stamp=2))
    assert answers.missing(), "a late word about the frame before"


def test_others_are_handed_on_all_of_them_in_an_order_of_their_own() -> None:
    boxes = [said(BOX, FRAME, b"1", 7), said(BOX, ELSEWHEN, b"2", 7), said(BOX, FRAME, b"3", 3)]
    answers = answering(*boxes, said(4711, FRAME), relayed=(MessageFilter("box", BOX),))
    assert [(e.payload, e.sample_time) for e in answers.collect()] == [(b"3", FRAME), (b"1", FRAME), (b"2", FRAME)]
    assert answers.collect() == []


def test_answers_under_another_stamp_are_no_answers_but_are_handed_on() -> None:
    answers = AnsweringApplication(LINK, (MessageFilter("steer/0", STEER, 0), MessageFilter("pedal/3", PEDAL, 3)))
    show(answers, FRAME)
    for envelope in (said(STEER, FRAME, stamp=99), said(STEER, FRAME, stamp=99), said(PEDAL, FRAME, stamp=3)):
        answers.take(envelope)
    assert answers.missing() == "steer/0 missing"
    assert [(e.data_type, e.sender_stamp) for e in answers.collect()] == [(STEER, 99), (STEER, 99), (PEDAL, 3)]
    show(answers, NEXT)
    answers.take(said(STEER, NEXT))
    answers.take(said(PEDAL, NEXT, stamp=3))
    assert not answers.missing()


def test_a_flood_is_far_more_than_one_surplus_message_to_a_frame() -> None:
    answers = answering(said(STEER, FRAME), *[said(STEER, FRAME)] * MOST_SURPLUS)
    with pytest.raises(ApplicationFails, match="more than 100 steers that nobody asked for"):
        answers.take(said(STEER, FRAME))
    answers.expect([NEXT])
    answers.take(said(STEER, FRAME))
