"""A test of one's own recording: what is played, and the signal that is judged, as the recording has them."""

import json
import math
import re
import sys
import tempfile
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from dodo_dsl.application.model import ApplicationSource
from dodo_dsl.check import wiring_rules
from dodo_dsl.cli import rec_bag
from dodo_dsl.cli.errors import UsageError, files_of_the_user
from dodo_dsl.cli.existing_application import Pictures
from dodo_dsl.cli.new_files import New, filled, spec_files
from dodo_dsl.cli.rec_actions import messages_for
from dodo_dsl.diagnostics import shown_path
from dodo_dsl.opendlv import recording_times
from dodo_dsl.opendlv.address import IMAGE
from dodo_dsl.opendlv.envelope import encode_frame
from dodo_dsl.opendlv.message_columns import Numbers
from dodo_dsl.opendlv.message_set import OWN_IDS, MessageError, MessageSet
from dodo_dsl.opendlv.recording import Recording
from dodo_dsl.rec import contents
from dodo_dsl.rec.contents import MessageStream
from dodo_dsl.rec.frames import packets

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
BOUNDS = {"opendlv.proxy.GroundSteeringRequest": "38 deg", "opendlv.proxy.PedalPositionRequest": "1"}
"""The size that answers to pictures may have, by the Kiwi car's vehicle; of other messages any."""
SHARE_OF_MEAN, SHARE_OF_DISTANCE = 10, 50
"""Limits of the distance to the recorded signal, in percent of its range; of the mean at most half of a constant's."""
FEWEST = 10
DEFAULT_GAP_S = 1
"""Longer gaps are shortened by the player unless it is set otherwise, but not in a target."""
LONGEST_GAP_S, LONGEST_S = 3600, 86_400
"""Of what a player plays, and of a test."""
LARGEST_BYTES = 200 << 20
_START_UP_S = 10
_MEMORIES = ("video0.argb", "video0.i420")
"""In which rec-replay shows pictures by default."""
_SUFFIX = ".rec"
_APART = 1_000_000
"""Microseconds between the delays of two senders from which on one of them sends by another clock."""
_PLAIN = re.compile(r"[\w.][\w./ -]*", re.ASCII)


@dataclass(frozen=True)
class RecordedDrive:
    """What a recording holds: ``cameras`` are sender stamps, that with most pictures, of ``size``, first.

    ``duration`` and ``gap``, the longest time without a message, are in s as they are played. ``retimed`` are messages
    with their times of receipt, where sample times come from different drives; None elsewhere. Without a ``target`` the
    pictures have to be answered, by the message ``answer``.
    """

    duration: float
    gap: float
    retimed: bytes | None
    cameras: tuple[int, ...]
    target: MessageStream | None
    answer: str
    values: tuple[float, ...]
    requests: tuple[str, ...]
    others: tuple[int, ...]
    size: tuple[int, int]

    @property
    def range(self) -> float:
        """Of the signal; its largest value where it is constant, 1 if that is 0."""
        values = self.values or (0.0,)
        return max(values) - min(values) or max(map(abs, values)) or 1.0

    @property
    def of_constant(self) -> float:
        """The mean distance of the signal to the constant that is nearest to it."""
        return float(np.abs(np.array(self.values) - np.median(self.values)).mean()) if self.values else 0.0


@contextmanager
def recording_of(path: Path) -> Iterator[tuple[Path, str]]:
    """A recording, and what became of the topics of the bag that ``path`` may be; raises UsageError, BagError."""
    if not rec_bag.is_bag(path):
        yield path, ""
        return
    with tempfile.TemporaryDirectory() as folder, files_of_the_user():
        place = Path(folder) / f"{path.resolve().stem}{_SUFFIX}"
        problems: list[str] = []
        said = rec_bag.into(path, place, False, problems.append, sys.stderr)
        yield place, f"{shown_path(str(path))}: {said}" + "".join(f"  {each}\n" for each in problems)


def look(path: Path, sent: Collection[str]) -> RecordedDrive:
    """Looks into a recording; ``sent`` are messages of the application. Raises UsageError with nothing to judge."""
    with files_of_the_user(), Recording(path) as recording:
        if recording.size > LARGEST_BYTES:
            raise UsageError(f"'{path}' is larger than {LARGEST_BYTES >> 20} MB; cut out a part: dodo rec cut --help")
        _, messages = messages_for(recording, (), lambda _: None)
        index = recording.index
        played = np.flatnonzero(~np.isin(index["data_type"], list(OWN_IDS)))
        if not len(played):
            raise UsageError(f"'{path}' has no messages to play")
        if fault := recording_times.fault(recording, played):
            raise UsageError(f"'{path}' cannot be played: {fault}; 'dodo rec cut' writes a part without them")
        received = _receipts(recording, played)
        streams = sorted(contents.streams(recording, messages), key=lambda stream: -stream.count)
        signals = [name for name in SIGNALS if not sent or name in sent]
        target = _target(path, streams, signals)
        values = _values(path, recording, messages, target) if target else ()
        cameras = tuple(stream.sender_stamp for stream in streams if stream.id == IMAGE)
        first = recording.rows(messages=[IMAGE], sender_stamps=cameras[:1])[:1]
        size = next(((each.width, each.height) for each in packets(recording, first)), (0, 0))
        times = np.sort(index["time"][played] if received is None else received[played])
        gaps = _played_gaps(path, np.diff(times) / 1e6, target)
        retimed = None if received is None else _retimed(recording, received)
    names = {stream.name for stream in streams if stream.name}
    return RecordedDrive(
        float(gaps.sum()),
        float(gaps.max(initial=0)),
        retimed,
        cameras,
        target,
        next(iter(signals)),
        values,
        tuple(sorted(name for name in names if name.endswith("Request") or name in sent)),
        tuple(s.sender_stamp for s in streams if target and s.id == target.id and s is not target),
        size,
    )


def _played_gaps(path: Path, gaps: NDArray[np.float64], target: MessageStream | None) -> NDArray[np.float64]:
    """Times between messages in s as a player has them; raises UsageError where no test can have them."""
    if gaps.max(initial=0) > LONGEST_GAP_S and target is None:
        gaps = np.minimum(gaps, DEFAULT_GAP_S)
    longest, whole = float(gaps.max(initial=0)), float(gaps.sum())
    if longest > LONGEST_GAP_S or math.ceil(whole) + 2 * _START_UP_S > LONGEST_S:
        found = f"takes {recording_times.span(whole)} with a break of {recording_times.span(longest)}"
        raise UsageError(f"'{path}' {found}, and a test 24 h with one of 1 h; cut out a part: dodo rec cut --help")
    return gaps


def _receipts(recording: Recording, rows: Numbers) -> Numbers | None:
    """When each message was received, in us, where the sample times of rows come from several drives; else None."""
    received = np.concatenate([batch.times[1] for batch in recording.batches()])
    sampled = recording.index["sampled"]
    known = rows[(received[rows] != 0) & (sampled[rows] != 0)]
    delays = [np.median((received - sampled)[part]) for part in recording_times.streams(recording.index, known)]
    is_apart = len(delays) > 1 and max(delays) - min(delays) > _APART
    return np.where(received == 0, recording.index["time"], received) if is_apart and received[rows].all() else None


def _retimed(recording: Recording, times: Numbers) -> bytes:
    """The recording with these sample times."""
    pairs = zip(recording.envelopes(), times.tolist(), strict=True)
    return b"".join(encode_frame(envelope._replace(sample_time=time)) for envelope, time in pairs)


def _target(path: Path, streams: list[MessageStream], signals: list[str]) -> MessageStream | None:
    """Which of the ``signals`` to judge; None if there are only pictures, which have to be answered."""
    for name in signals:
        found = [stream for stream in streams if stream.name == name and stream.count >= FEWEST]
        if found:
            return min(found, key=lambda stream: stream.sender_stamp != 0)  # as applications send it
    if signals and any(stream.id == IMAGE and stream.count >= FEWEST for stream in streams):
        return None
    expected = ", ".join(signals) or f"{', '.join(SIGNALS)}, of which the application declares none"
    what = f"expected {FEWEST} or more messages of one of {expected}, or as many pictures"
    raise UsageError(f"'{path}' has no signal to judge, {what}")


def _values(path: Path, recording: Recording, messages: MessageSet, target: MessageStream) -> tuple[float, ...]:
    rows = recording.by_time(recording.rows(messages=[target.id], sender_stamps=[target.sender_stamp]))
    field = SIGNALS[target.name or ""]
    try:
        values = [float(getattr(messages.decode(e.data_type, e.payload), field)) for e in recording.envelopes(rows)]
    except MessageError as error:
        raise UsageError(f"'{path}': {error}") from None
    return tuple(value for value in values if math.isfinite(value)) or (0.0,)


def files(
    name: str, path: Path, drive: RecordedDrive, registry: Path, root: Path, pictures: Pictures, of_ros: bool
) -> tuple[list[New], str]:
    """The test's files, its spec first, with the recording where the registry has it not yet; and what was found.

    Nodes ``of_ros`` answer in their own time, which is the test's, and not with the sample time of a picture.
    """
    place = path.resolve()
    copies = []
    stem = re.sub(r"[\0-\x1f\x7f]", "-", path.stem if path.suffix == _SUFFIX else path.name)
    if drive.retimed is not None or f"{stem}{_SUFFIX}" != path.name or not place.is_relative_to(registry.resolve()):
        name_of_copy = f"{stem}{'' if drive.retimed is None else '-as-received'}{_SUFFIX}"
        content = place.read_bytes() if drive.retimed is None else drive.retimed
        copies = [New(registry / "recordings" / name_of_copy, content)]
        place = registry.resolve() / "recordings" / name_of_copy
        if place.is_file() and place.read_bytes() == copies[0].content:
            copies = []
    message = (drive.target and drive.target.name) or drive.answer
    field, does = SIGNALS[message], "as in the recorded drive" if drive.target else "for each picture of"
    spec = filled(
        "recording/dil-open-loop.dodo.yml",
        name=name,
        description=_quoted(f"Send {message.rpartition('.')[2]} {does} {path.name}."),
        path=_quoted(f"../{place.relative_to(registry.resolve()).as_posix()}"),
        timeout=math.ceil(drive.duration) + 2 * _START_UP_S,
        max_time=math.ceil(drive.duration) + _START_UP_S,
        cameras=drive.cameras,
        in_test_time=of_ros or not drive.cameras,
        memories=pictures.parameters("rec-replay"),
        max_gap=math.ceil(drive.gap) if drive.gap > DEFAULT_GAP_S else 0,
        without=drive.requests,
        message=message,
        field=field,
        is_target=drive.target is not None,
        bound=BOUNDS.get(message, ""),
        sender=drive.target.sender_stamp if drive.target else 0,
        mean=_limit(min(drive.range * SHARE_OF_MEAN / 100, drive.of_constant / 2 or math.inf)),
        distance=_limit(drive.range * SHARE_OF_DISTANCE / 100),
        share_of_distance=SHARE_OF_DISTANCE,
    )
    return [*spec_files(name, registry / name, root, spec), *copies], _found(path, drive, field)


def unpassable(path: Path, drive: RecordedDrive, application: ApplicationSource | None, pictures: Pictures) -> str:
    """A warning if services of the application read pictures, of which the recording has none, or of another size."""
    own, recorded = (f"{width}x{height}" for width, height in ((pictures.width, pictures.height), drive.size))
    if pictures.service and drive.cameras and recorded != own:
        found = f"the pictures of '{path.name}' are {recorded}, and '{pictures.service}' seems to take {own}"
        return f"warning: {found}: it gets the recorded size\n"
    names = (*_MEMORIES, *pictures.memories.values())
    readers = [] if drive.cameras or application is None else wiring_rules.readers(application, names)
    if not readers:
        return ""
    named = " and ".join(f"'{name}'" for name in readers)
    waits = "waits" if len(readers) == 1 else "wait"
    of_it = f"and '{path.name}' has none, so the test cannot pass"
    return f"warning: {named} of the application {waits} for pictures, {of_it}\n"


def _quoted(text: str) -> str:
    """A text as a value of YAML."""
    return text if _PLAIN.fullmatch(text) else json.dumps(text)


def _limit(value: float) -> str:
    """Two significant digits."""
    digits = max(0, 1 - math.floor(math.log10(value)))
    return f"{value:.{min(digits, 9)}f}"


def _found(path: Path, drive: RecordedDrive, field: str) -> str:
    name = path.name if path.is_absolute() else shown_path(str(path))
    lines = [f"{name}: {drive.duration:.1f} s, {_cameras(drive.cameras)}"]
    if drive.target is None:
        lines.append(
            f"judged: whether each picture is answered by {drive.answer}/0, because there is no recorded signal"
        )
    else:
        target = f"{drive.target.name}/{drive.target.sender_stamp}"
        values = f"{len(drive.values)} values from {min(drive.values):g} to {max(drive.values):g}"
        lines.append(f"judged: {field} of {target}, {values}")
    if drive.others:
        lines.append(
            f"other sender stamps of it are {', '.join(map(str, drive.others))}: change 'target-sender' for them"
        )
    if drive.retimed is not None:
        lines.append("its sample times are of several drives: the test has a copy with the times of receipt instead")
    return "".join(f"{line}\n" for line in lines)


def _cameras(cameras: tuple[int, ...]) -> str:
    if not cameras:
        return "no camera"
    others = f", not of {', '.join(map(str, cameras[1:]))}" if cameras[1:] else ""
    return f"pictures of the camera with sender stamp {cameras[0]}{others}"
