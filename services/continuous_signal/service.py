"""The evaluator of a signal on the bus."""

from pathlib import Path
from typing import Any

import numpy as np

from dodo_dsl.opendlv.envelope import MICROSECONDS
from dodo_dsl.opendlv.message_set import MessageSet
from services.base import Context, Flags
from services.base.service import SINGLE
from services.continuous_signal.measures import SignalLimits
from services.continuous_signal.model import SignalEvaluator
from services.continuous_signal.target import (
    Signal,
    Target,
    Times,
    check,
    due_times,
    is_single,
    picture_times,
    read_recording,
    read_table,
)

RECORDING = ".rec"


class ContinuousSignal(SignalEvaluator):
    """Takes the signal, and its target where that comes live, under their sender stamps."""

    def __init__(self, context: Context) -> None:
        """Raises ValueError for flags that leave something open."""
        flags = context.flags
        signal = check(Signal(flags["message"], flags["sender"], flags["field"]), context.messages)
        other = _target_signal(flags, signal)
        target = _target(flags, other, context.messages)
        if target is None and str(other) == str(signal):
            raise ValueError("no target: give --target, or --target-sender for a live one")
        name, from_begin = f"{signal.field} of {signal}", flags["align"] == "begin"
        if target is not None and from_begin and target.span[0] >= flags["max-time"]:
            first = f"{flags['target']}: the target begins {target.span[0]:,.1f} s after the start"
            raise ValueError(f"{first}, when --max-time={flags['max-time']:g} is over: nothing could be judged")
        limits = SignalLimits(flags, SINGLE if is_single(signal, context.messages) else 0.0)
        frames = None if target is None else _frames(flags, target)
        super().__init__(name, target, limits, from_begin, frames, is_copied=not from_begin)
        self._source, self._target_source = signal, other
        self.plot.name = f"{signal.field} of {signal.message.rpartition('.')[2]}/{signal.sender}"
        self.inputs = {(signal.message, signal.sender): self._take}
        if target is None:
            check(other, context.messages)
            self.inputs[other.message, other.sender] = self._take_target

    def _take(self, message: Any, sample_time: int) -> None:
        self.take(self._source.value(message), sample_time)

    def _take_target(self, message: Any, sample_time: int) -> None:
        self.take_target(self._target_source.value(message), sample_time)


build = ContinuousSignal


def _target_signal(flags: Flags, signal: Signal) -> Signal:
    sender = flags["target-sender"]
    return Signal(
        flags["target-message"] or signal.message,
        signal.sender if sender is None else sender,
        flags["target-field"] or signal.field,
    )


def _target(flags: Flags, signal: Signal, messages: MessageSet) -> Target | None:
    """The target from its file, None for one that comes live."""
    if not flags["target"]:
        return None
    path = Path(flags["target"])
    if path.suffix == RECORDING:
        return read_recording(path, check(signal, messages), messages)
    return read_table(path, signal.field, flags["align"] == "sample-time")


def _frames(flags: Flags, target: Target) -> Times | None:
    """The pictures that samples answer, as far as they are known, in us on the target's own scale.

    They are those of the recorded target, or that are played, or of the camera. With ``align: begin`` these have the
    test's time.
    """
    if flags["min-frame-share"] is None and flags["min-sign-share"] is None:
        return None
    sender, is_recorded = flags["video-sender"] or 0, Path(flags["target"]).suffix == RECORDING
    if flags["align"] != "begin":
        path = flags["target"] if is_recorded else flags["rec"]
        return picture_times(Path(path), sender, target.start) if path else None
    if flags["rec"]:
        return due_times(Path(flags["rec"]), sender, flags["start"] or 0.0, flags["end"], flags["timemod"] or 1.0)
    return np.arange(0, flags["max-time"] * MICROSECONDS, MICROSECONDS / flags["freq"]) if flags["freq"] else None
