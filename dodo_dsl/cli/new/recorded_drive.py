"""A test of a recording of one's own: what is played, and the signal that is judged, as the recording has them."""

import json
import math
import re
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path

from dodo_dsl.cli.errors import UsageError, files_of_the_user
from dodo_dsl.cli.new.new_file import New, filled
from dodo_dsl.cli.new.scaffold import spec_files
from dodo_dsl.cli.rec.message_sets import messages_for
from dodo_dsl.diagnostics import shown_path
from dodo_dsl.opendlv.messages.codec import MessageError
from dodo_dsl.opendlv.messages.message_set import MessageSet
from dodo_dsl.opendlv.messages.varints import Numbers
from dodo_dsl.opendlv.recordings.recording import Recording
from dodo_dsl.rec import contents
from dodo_dsl.rec.contents import MessageStream
from dodo_dsl.rec.frames import IMAGE

SIGNALS = {
    "opendlv.proxy.GroundSteeringRequest": "groundSteering",
    "opendlv.proxy.PedalPositionRequest": "position",
    "opendlv.proxy.GroundSpeedRequest": "groundSpeed",
    "opendlv.proxy.GroundAccelerationRequest": "groundAcceleration",
    "opendlv.proxy.AngleRequest": "angle",
}
"""Messages with a signal that can be judged and its field, the preferred ones first."""
SHARE_OF_MEAN, SHARE_OF_DISTANCE = 10, 50
"""Limits of the distance to the recorded signal, in percent of its range."""
FEWEST = 10
LARGEST_BYTES = 200 << 20
_START_UP_S = 10
_PLAIN = re.compile(r"[\w.][\w./ -]*", re.ASCII)


@dataclass(frozen=True)
class Drive:
    """What a recording holds: ``cameras`` are sender stamps, that with most pictures first; ``duration`` is in s."""

    duration: float
    cameras: tuple[int, ...]
    target: MessageStream
    values: tuple[float, ...]
    requests: tuple[str, ...]
    others: tuple[int, ...]

    @property
    def range(self) -> float:
        """Of the signal; its largest value where it is constant, 1 where that is 0."""
        return max(self.values) - min(self.values) or max(map(abs, self.values)) or 1.0


def look(path: Path, sent: Collection[str]) -> Drive:
    """Looks into a recording; ``sent`` are messages of the application. Raises UsageError without a signal to judge."""
    with files_of_the_user(), Recording(path) as recording:
        if recording.size > LARGEST_BYTES:
            raise UsageError(f"'{path}' is larger than {LARGEST_BYTES >> 20} MB; cut out a part: dodo rec cut --help")
        version, messages = messages_for(recording, (), lambda _: None)
        found = contents.look(recording, messages, version, None, lambda _: None)
        streams = sorted(found.streams, key=lambda stream: -stream.count)
        target = _target(path, streams)
        rows = recording.rows(messages=[target.id], sender_stamps=[target.sender_stamp])
        values = _values(path, recording, messages, target, recording.by_time(rows))
    names = {stream.name for stream in streams if stream.name}
    return Drive(
        found.duration,
        tuple(stream.sender_stamp for stream in streams if stream.id == IMAGE),
        target,
        values,
        tuple(sorted(name for name in names if name.endswith("Request") or name in sent)),
        tuple(s.sender_stamp for s in streams if s.id == target.id and s is not target),
    )


def _target(path: Path, streams: list[MessageStream]) -> MessageStream:
    for name in SIGNALS:
        for stream in streams:
            if stream.name == name and stream.count >= FEWEST:
                return stream
    expected = ", ".join(SIGNALS)
    raise UsageError(f"'{path}' has no signal to judge, expected {FEWEST} or more messages of one of {expected}")


def _values(
    path: Path, recording: Recording, messages: MessageSet, target: MessageStream, rows: Numbers
) -> tuple[float, ...]:
    field = SIGNALS[target.name or ""]
    try:
        values = [float(getattr(messages.decode(e.data_type, e.payload), field)) for e in recording.envelopes(rows)]
    except MessageError as error:
        raise UsageError(f"'{path}': {error}") from None
    return tuple(value for value in values if math.isfinite(value)) or (0.0,)


def files(name: str, path: Path, drive: Drive, registry: Path, root: Path) -> tuple[list[New], str]:
    """The test's files, its spec first, with the recording where the registry has it not yet; and what was found."""
    place = path.resolve()
    copies = []
    if not place.is_relative_to(registry.resolve()):
        copies = [New(registry / "recordings" / path.name, place.read_bytes())]
        place = registry.resolve() / "recordings" / path.name
        if place.is_file() and place.read_bytes() == copies[0].content:
            copies = []
    message, field = drive.target.name or "", SIGNALS[drive.target.name or ""]
    spec = filled(
        "recording/dil-open-loop.dodo.yml",
        name=name,
        description=_quoted(f"Send {message.rpartition('.')[2]} as in the recorded drive {path.name}."),
        path=_quoted(f"../{place.relative_to(registry.resolve()).as_posix()}"),
        timeout=math.ceil(drive.duration) + 2 * _START_UP_S,
        max_time=math.ceil(drive.duration) + _START_UP_S,
        cameras=drive.cameras,
        without=drive.requests,
        message=message,
        field=field,
        sender=drive.target.sender_stamp,
        mean=_limit(drive.range * SHARE_OF_MEAN / 100),
        distance=_limit(drive.range * SHARE_OF_DISTANCE / 100),
        share_of_mean=SHARE_OF_MEAN,
        share_of_distance=SHARE_OF_DISTANCE,
    )
    return [*spec_files(name, registry / name, root, spec), *copies], _found(path, drive, field)


def _quoted(text: str) -> str:
    """A text as a value of YAML."""
    return text if _PLAIN.fullmatch(text) else json.dumps(text)


def _limit(value: float) -> str:
    """Two significant digits."""
    digits = max(0, 1 - math.floor(math.log10(value)))
    return f"{value:.{min(digits, 9)}f}"


def _found(path: Path, drive: Drive, field: str) -> str:
    target = f"{drive.target.name}/{drive.target.sender_stamp}"
    lines = [
        f"{shown_path(str(path))}: {drive.duration:.1f} s, {_cameras(drive.cameras)}",
        f"judged: {field} of {target}, {len(drive.values)} values from {min(drive.values):g} to {max(drive.values):g}",
    ]
    if drive.others:
        lines.append(
            f"other sender stamps of it are {', '.join(map(str, drive.others))}: change 'target-sender' for them"
        )
    if not drive.cameras:
        lines.append("the test is in real time, as only pictures can be waited for in lockstep")
    return "".join(f"{line}\n" for line in lines)


def _cameras(cameras: tuple[int, ...]) -> str:
    if not cameras:
        return "no camera"
    others = f", not of {', '.join(map(str, cameras[1:]))}" if cameras[1:] else ""
    return f"pictures of the camera with sender stamp {cameras[0]}{others}"
