"""The clock of a test in lockstep as a program."""

import os
import sys
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

from services.base import Context, RealTimeClock, Service, run
from services.base.clock import MICROSECONDS
from services.base.clock_link import socket_path
from services.base.flags import Flags
from services.base.members import SenderTable
from services.base.service import period_of
from services.clock.agent import TimeAgent
from services.clock.answers import Answers, filters
from services.clock.exchange import Roles, ServiceSilent, Timing
from services.clock.resting import SentMessages
from services.clock.service import ClockService, OwnTime


def build(context: Context) -> Service:
    flags = context.flags
    ids = {name: context.messages.id(name) for name in context.messages.names()}
    answers: Answers | SentMessages = _answers(flags, ids)
    own_time = None
    if flags["time-folder"] and not os.environ.get("DODO_ANSWERS"):
        own_time = OwnTime(TimeAgent(Path(flags["time-folder"])), tuple(flags["application"]))
        context.resources.callback(own_time.agent.close)
        with suppress(ServiceSilent):  # the first step says so; it is opened before an application could find it
            own_time.agent.open(lambda: False)
        answers = SentMessages(answers.filters)
    roles = Roles(*(tuple(flags[name]) for name in ("advance", "sense", "judge", "watch")))
    assert context.session is not None, "the program gives its session"
    senders = SenderTable.load(context.messages)
    answering = (each.data_type for each in answers.filters)
    context.session.hear_only([*answering, *senders.ids])
    timeout = round(flags["timeout"] * MICROSECONDS)
    timing = Timing(period_of(flags["freq"]), timeout, flags["max-response"])
    return ClockService(
        context.session, socket_path(), roles, answers, timing, senders, own_time, prints=flags["prints"]
    )


def _answers(flags: Flags, ids: Mapping[str, int]) -> Answers:
    done = filters([flags["done"]] if flags["done"] else [], ids)
    return Answers(filters(flags["answers"], ids), filters(flags["hears"], ids), done[0] if done else None)


if __name__ == "__main__":
    sys.exit(run(Path(__file__).parent, build, clock=RealTimeClock()))
