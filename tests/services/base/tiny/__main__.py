"""A service for the tests of the base."""

import json
import math
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from services.base import Check, Context, Judged, Output, Service, UnjudgeableError, Verdict, period_of, run


class Echo(Service):
    """Says the last distance as a pedal position, and since when the test runs as an angle."""

    def __init__(self, context: Context) -> None:
        self.period = period_of(context.flags["freq"])
        self.inputs = {("opendlv.proxy.DistanceReading", 2): self.take}
        self.messages = context.messages
        self.distance, self.sampled, self.begun = 0.0, 0, 0

    def begin(self, now: int) -> None:
        self.begun = now

    def take(self, message: Any, sample_time: int) -> None:
        self.distance, self.sampled = message.distance, sample_time

    def update(self, now: int) -> Iterable[Any]:
        yield self.messages.type("opendlv.proxy.PedalPositionRequest")(position=self.distance)
        yield Output(self.messages.type("opendlv.proxy.AngleReading")(angle=self.sampled + self.begun), 7)


class Judge(Service):
    """Only messages drive it: a distance over 1 m fails at once, the end of input passes."""

    period = None

    def __init__(self, context: Context) -> None:
        self.inputs = {("opendlv.proxy.DistanceReading", None): self.take}
        self.context = context
        self.judged = Judged()
        self.series = self.judged.series("Distance", "m", high=1)

    def take(self, message: Any, sample_time: int) -> None:
        self.series.add(sample_time, message.distance)
        if message.distance > 1.0:
            self.verdict = Verdict("failed", "too far", (Check("range", message.distance, {"max": 1.0}, "m", False),))

    def end_of_input(self, now: int) -> None:
        self.context.log.debug("the end has come")
        self.verdict = Verdict("passed", "nothing was far", (Check("distance", math.nan),))

    def update(self, now: int) -> Iterable[Any]:
        raise AssertionError("it has no period")


class Source(Service):
    """Sends three voltages and is at its end; with a memory not before the test has begun."""

    period = 10_000

    def __init__(self, context: Context) -> None:
        self.type = context.messages.type("opendlv.proxy.VoltageReading")
        self.count, self.begun = 0, False
        self.awaits_begin = bool(context.flags["name"])

    def begin(self, now: int) -> None:
        self.begun = True

    def update(self, now: int) -> Iterable[Any]:
        self.count += 1
        self.finished = self.count >= 3 and (self.begun or not self.awaits_begin)
        return [self.type(voltage=self.count)]


class Broken(Service):
    """Fails in its first update: by an error, one in a library, or one that is a sentence for users."""

    def __init__(self, context: Context) -> None:
        self.role = context.flags["role"]

    def update(self, now: int) -> Iterable[Any]:
        if self.role == "library":
            json.loads("[")
        if self.role == "unjudgeable":
            raise UnjudgeableError("the map has no goal")
        raise ZeroDivisionError("a model\nwent wrong")


def build(context: Context) -> Service:
    if context.flags["name"]:
        context.memory(context.flags["name"], 100)
    if context.flags["role"] == "unbuildable":
        raise ValueError("/no/such/map: cannot be read")
    roles: dict[str, Any] = {"echo": Echo, "judge": Judge, "source": Source}
    service: Service = roles[context.flags["role"]](context) if context.flags["role"] in roles else Broken(context)
    return service


if __name__ == "__main__":
    sys.exit(run(Path(__file__).parent, build))
