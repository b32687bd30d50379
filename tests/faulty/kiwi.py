"""The programs of the example application, and decorators that make them faulty.

A fault alters the one program of its process: it replaces a function of it by a wrapped one.
"""

import importlib.util
import itertools
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
PERCEPTION, STEERING, DRIVER = "perception", "steering", "driver"
FOLDERS = {PERCEPTION: "kiwi", STEERING: "kiwi", DRIVER: "ranges"}

Program = Any
"""A module, ``perception``, ``steering`` or ``driver``, loaded for this process alone."""

Make = Callable[[Program], None]
"""Makes a program faulty."""

Driving = Callable[[float, float], tuple[float, float]]
"""Steering request (rad) and pedal of a frame, as they should be and as they are sent."""

Cones = list[Any]
"""Of ``perception.Patch``: colour and box in fractions of the image."""

Sent = tuple[Any, int | None, int]
"""A message with its sample time (us, None is now) and its sender stamp."""

HANDSHAKE = "SystemStatusMessage"


def numbered() -> Callable[[], int]:
    """Gives 0, 1, 2 and so on: which frame or message it is."""
    numbers = itertools.count()
    return lambda: next(numbers)


def program(name: str) -> Program:
    """A new copy of one of the examples' programs."""
    spec = importlib.util.spec_from_file_location(name, EXAMPLES / FOLDERS[name] / f"{name}.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def driving(change: Driving) -> Make:
    """Changes what ``Driver.drive`` decides."""

    def make(steering: Program) -> None:
        drive = steering.Driver.drive
        steering.Driver.drive = lambda self, *found: change(*drive(self, *found))

    return make


def finding(change: Callable[[Cones], Cones]) -> Make:
    """Changes which cones ``find`` finds."""

    def make(perception: Program) -> None:
        find = perception.find
        perception.find = lambda image: change(find(image))

    return make


def seeing(change: Callable[[Any], Any]) -> Make:
    """Changes the image in which ``find`` looks, an array of height x width x 4 bytes."""

    def make(perception: Program) -> None:
        find = perception.find
        perception.find = lambda image: find(change(image))

    return make


def announcing(change: Callable[[Cones, int, int], tuple[Cones, int, int]]) -> Make:
    """Changes cones, number and sample time (us) of the frames that ``announce`` sends."""

    def make(perception: Program) -> None:
        announce = perception.announce
        perception.announce = lambda session, cones, frame, sample_time, source: announce(
            session, *change(cones, frame, sample_time), source
        )

    return make


def sending(change: Callable[[Sent], Iterable[Sent]]) -> Make:
    """Changes what a program sends, message by message, but for the question whether the other one listens."""

    def make(module: Program) -> None:
        plain = module.Session

        class FaultySession(plain):  # type: ignore[misc, valid-type]
            def send(self, message: Any, sample_time: int | None = None, sender_stamp: int = 0) -> bytes:
                sent: Sent = (message, sample_time, sender_stamp)
                frame = b""
                for each in [sent] if message.DESCRIPTOR.name == HANDSHAKE else change(sent):
                    frame = super().send(*each)
                return frame

        module.Session = FaultySession

    return make


def framing(act: Callable[[], None]) -> Make:
    """Does something before each frame is processed, in either program."""

    def make(module: Program) -> None:
        owner, name = (module.Driver, "drive") if module.__name__ == STEERING else (module, "find")
        process = getattr(owner, name)

        def act_and_process(*words: Any) -> Any:
            act()
            return process(*words)

        setattr(owner, name, act_and_process)

    return make
