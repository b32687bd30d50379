"""A test of one's own recording: a template with its file, its duration and the first signal that can be judged."""

import json
import math
import re
from collections.abc import Collection
from pathlib import Path

import numpy as np

from dodo_dsl.cli.errors import UsageError, files_of_the_user
from dodo_dsl.cli.existing_application import Pictures
from dodo_dsl.cli.new_files import New, filled, spec_files
from dodo_dsl.cli.rec_actions import messages_for
from dodo_dsl.opendlv import recording_times
from dodo_dsl.opendlv.address import IMAGE
from dodo_dsl.opendlv.envelope import MICROSECONDS
from dodo_dsl.opendlv.message_set import MessageError, MessageSet
from dodo_dsl.opendlv.recording import Recording
from dodo_dsl.rec.contents import MessageStream, streams

SIGNALS = {
    "opendlv.proxy.GroundSteeringRequest": "groundSteering",
    "opendlv.proxy.PedalPositionRequest": "position",
    "opendlv.proxy.GroundSpeedRequest": "groundSpeed",
    "opendlv.proxy.GroundAccelerationRequest": "groundAcceleration",
    "opendlv.proxy.AxleAngularVelocityRequest": "axleAngularVelocity",
    "opendlv.proxy.AngleRequest": "angle",
    "opendlv.proxy.GroundMotionRequest": "yawRate",
}
"""Messages with a signal that can be judged and its field, the preferred ones first."""
FEWEST = 10
"""Messages of a signal."""
_LONGEST_GAP = MICROSECONDS
"""The player's, if it is not set otherwise."""
_START_UP_S = 10
_SUFFIX = ".rec"
_PLAIN = re.compile(r"[\w.][\w./ -]*", re.ASCII)


def files(
    name: str, path: Path, sent: Collection[str], registry: Path, root: Path, pictures: Pictures, of_ros: bool
) -> tuple[list[New], str]:
    """The test's files, its spec first, with the recording where the registry does not have it; and what was found.

    ``sent`` are messages of the application; nodes ``of_ros`` answer in their own time, which is the test's, and not
    with the sample time of a picture. Raises UsageError with nothing to judge.
    """
    if path.is_dir() or path.suffix in (".mcap", ".db3"):
        raise UsageError(f"'{path}' is a bag of ROS 2, expected a recording: dodo rec import {path}")
    with files_of_the_user(), Recording(path) as recording:
        duration = math.ceil(_duration(recording))
        _, messages = messages_for(recording, (), lambda _: None)
        found = streams(recording, messages)
        target, message = _signal(path, found, [each for each in SIGNALS if not sent or each in sent])
        mean = _limit(recording, messages, target) if target else ""
    cameras = sorted((each for each in found if each.id == IMAGE), key=lambda each: -each.count)
    place, copies = path.resolve(), []
    if not place.is_relative_to(registry.resolve()) or path.suffix != _SUFFIX:
        file = re.sub(r"[\0-\x1f\x7f]", "-", path.name.removesuffix(_SUFFIX)) + _SUFFIX
        place = registry.resolve() / "recordings" / file
        if not place.is_file() or place.read_bytes() != path.read_bytes():
            copies = [New(place, path.read_bytes())]
    short = message.rpartition(".")[2]
    spec = filled(
        "recording/dil-open-loop.dodo.yml",
        name=name,
        description=_quoted(f"Send {short} {'as recorded in' if target else 'for each picture of'} {path.name}."),
        path=_quoted(f"../{place.relative_to(registry.resolve()).as_posix()}"),
        timeout=duration + 2 * _START_UP_S,
        max_time=duration + _START_UP_S,
        camera=cameras[0].sender_stamp if cameras else 0,
        in_test_time=of_ros or not cameras,
        memories=pictures.parameters("rec-replay") if cameras else {},
        message=message,
        field=SIGNALS[message],
        sender=target.sender_stamp if target else 0,
        mean=mean,
    )
    judged = f"{SIGNALS[message]} of {message}/{target.sender_stamp}" if target else f"answers to pictures by {message}"
    return [*spec_files(name, registry / name, root, spec), *copies], f"{path.name}: {duration} s, judged: {judged}\n"


def _duration(recording: Recording) -> float:
    """As it is played, in s; raises UsageError."""
    rows, _, due = recording_times.played(recording, 0, None, _LONGEST_GAP, 1)
    if not len(rows):
        raise UsageError(f"'{recording.path}' has no messages to play")
    if fault := recording_times.fault(recording, np.sort(rows)):
        raise UsageError(f"'{recording.path}' cannot be played: {fault}; 'dodo rec cut' writes a part without them")
    return float(due[-1]) / MICROSECONDS


def _signal(path: Path, found: list[MessageStream], signals: list[str]) -> tuple[MessageStream | None, str]:
    """Which of the ``signals`` to judge, with its message; without one that of answers to pictures."""
    for name in signals:
        if of_it := [each for each in found if each.name == name and each.count >= FEWEST]:
            return min(of_it, key=lambda each: each.sender_stamp != 0), name  # as applications send it
    if signals and any(each.id == IMAGE for each in found):
        return None, signals[0]
    expected = ", ".join(signals) or f"{', '.join(SIGNALS)}, of which the application declares none"
    raise UsageError(f"'{path}' has no signal to judge, expected {FEWEST} or more messages of one of {expected}")


def _limit(recording: Recording, messages: MessageSet, target: MessageStream) -> str:
    """Half of the mean distance that the best constant reaches, 0.1 of a constant signal; two significant digits."""
    rows = recording.rows(messages=[target.id], sender_stamps=[target.sender_stamp])
    field = SIGNALS[target.name or ""]
    try:
        values = np.array([getattr(messages.decode(e.data_type, e.payload), field) for e in recording.envelopes(rows)])
    except MessageError as error:
        raise UsageError(f"'{recording.path}': {error}") from None
    values = values[np.isfinite(values)]
    distance = float(np.abs(values - np.median(values)).mean()) / 2 if len(values) else 0.0
    distance = distance or 0.1
    return f"{distance:.{min(max(0, 1 - math.floor(math.log10(distance))), 9)}f}"


def _quoted(text: str) -> str:
    """A text as a value of YAML."""
    return text if _PLAIN.fullmatch(text) else json.dumps(text)
