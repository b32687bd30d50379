"""The player on the bus."""

import logging
import math
import os
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from google.protobuf.message import Message

from dodo_dsl.opendlv import message_versions, pixels
from dodo_dsl.opendlv.envelope import MICROSECONDS
from dodo_dsl.opendlv.message_set import MessageSet
from dodo_dsl.opendlv.recording import Recording
from dodo_dsl.opendlv.recording_times import DAY
from services.base import Context, Service
from services.base.loop import TEST_BEGIN
from services.base.pictures import Memories, memories, show
from services.base.service import Framed, Output, period_of
from services.rec_replay.selection import Part, Player, select
from services.rec_replay.stream import EntryStream, Pictures, first_frame

LOOKS_HZ = 1000.0
LARGEST_FRAME = 65_480
MOST_TOGETHER = 256
STATUS_PERIOD = MICROSECONDS
STATUS, NOT_SHOWN = "cluon.data.PlayerStatus", "dodo.NotShown"
_PLAYING = 2

_log = logging.getLogger(__name__)


class Replay(Service):
    """Sends due messages and shows pictures; ``settle`` microseconds after the last of them the input ends.

    With ``shifts`` messages and pictures get the test time at which they are due, else they keep their sample times.
    """

    period = period_of(LOOKS_HZ)

    def __init__(
        self,
        player: Player,
        stream: EntryStream,
        memories: Memories,
        messages: MessageSet,
        shifts: bool,
        settle: int,
        expect: Callable[[int], None],
    ) -> None:
        self._player, self._stream, self._memories = player, stream, memories
        self._status, self._not_shown = messages.type(STATUS), messages.type(NOT_SHOWN)
        self._shifts, self._settle = shifts, settle
        self._too_large = self._lost = self._misfits = self._round = 0
        self._reported = -STATUS_PERIOD
        self._end: int | None = None
        self._pictures = np.flatnonzero(stream.shown if stream.shown.any() else np.ones_like(stream.shown))
        """Or messages where there are no pictures: with each of them lockstep goes on."""
        self._expect = expect

    def begin(self, now: int) -> None:
        self._player.playing = True

    def update(self, now: int) -> Iterator[Output | list[Framed]]:
        player = self._player
        player.advance(now)
        if player.round != self._round:
            self._stream.rewind()
            self._round = player.round
        together: list[Framed] = []
        while (taken := player.take()) is not None:
            entry, due = taken
            is_shown = self._memories and self._stream.shown[entry]
            if together and (is_shown or len(together) == MOST_TOGETHER):  # before its picture is decoded
                yield together
                together = []
            envelope, frame, is_sent, picture = self._stream.take()
            too_large = len(frame) > LARGEST_FRAME
            if self._shifts:
                envelope, frame = envelope._replace(sent=due, sample_time=due), b""
            if is_shown and not self._show(picture, envelope.sample_time):
                yield Output(self._missed(entry, due), 0, due)
            if is_sent and too_large:
                self._too_large += 1
            elif is_sent:
                together.append((envelope, frame))
        yield together
        if not player.ended:
            self._stream.prepare()
        elif self._end is None:
            self._end = now + self._settle
        self.finished = self._end is not None and now >= self._end
        self._expect(self._next_picture(now))
        if now - self._reported >= STATUS_PERIOD:
            self._reported = now
            status = self._status(
                state=_PLAYING, numberOfEntries=len(self._stream.times), currentEntryForPlayback=player.position
            )
            yield Output(status, 0)

    def _show(self, picture: Pictures | None, sample_time: int) -> bool:
        if picture is None or picture[0].nbytes != self._memories[0][0].size:
            self._misfits += picture is not None
            return False
        show(self._memories, *picture, sample_time)
        return True

    def _next_picture(self, now: int) -> int:
        """The time of the update that shows the next picture or message, 0 when there is none or that is unknown."""
        if not self._player.playing or (due := self._next_due()) is None:
            return 0
        looks = math.ceil((due - now) / self.period)
        return now + round(looks * self.period)

    def _next_due(self) -> int | None:
        """When the next picture is due, None when there is none."""
        number = int(np.searchsorted(self._pictures, self._player.position))
        is_over = number == len(self._pictures)
        if not len(self._pictures) or (is_over and not self._player.rewinds):
            return None
        return self._player.when(int(self._pictures[0 if is_over else number]), in_next_round=is_over)

    def close(self) -> None:
        if self._too_large:
            _log.warning("%d messages were not sent: they are too large for the bus", self._too_large)

    def _missed(self, entry: int, due: int) -> Message:
        """The message that a picture was not shown, and until when: evaluators expect no answer to it."""
        number, times, next_due = int(np.searchsorted(self._pictures, entry)), self._stream.times, self._next_due()
        until = due + DAY if next_due is None else next_due
        sampled = due if self._shifts else int(times[entry])
        later = self._pictures[number + 1 :][:1]
        length = until - due if self._shifts or not len(later) else int(times[later[0]]) - sampled
        self._lost, early = self._lost + 1, self._stream.decoder.early
        reasons = {"before the first key frame": early, "of another size than the first": self._misfits}
        why = (f", {count} of them {reason}" for reason, count in reasons.items() if count)
        self.notes = [f"{self._lost} frames could not be shown{''.join(why)}"]
        missed: Message = self._not_shown(number=number, sampled=sampled, sampledUntil=sampled + length, dueUntil=until)
        return missed


def build(context: Context) -> Service:
    """The service from its flags: the recording indexed, the memories made as large as its pictures are."""
    flags = context.flags
    recording = context.resources.enter_context(Recording(Path(flags["rec"])))
    if not len(recording):
        raise ValueError(f"{recording.path} is empty: there is nothing to play")
    if recording.damage:
        _log.warning("%s: %s", recording.path, recording.damage)
    part = _part(context, recording)
    player, stream = Player(part.due, flags["autorewind"]), EntryStream(recording, part)
    if not flags["await-begin"]:
        player.playing = True
    if context.session is not None:  # what it sends itself would fill its buffer
        context.session.hear_only([context.messages.id(TEST_BEGIN)])
    settle = round(flags["settle"] * MICROSECONDS)
    memories = _memories(context, recording, part)
    service = Replay(
        player, stream, memories, context.messages, flags["sample-times"] == "test", settle, context.clock.expect
    )
    service.late_after = _half_period(part)
    context.resources.callback(service.close)
    return service


def _half_period(part: Part) -> float | None:
    """Half of the mean time between pictures in microseconds; None if there are no two."""
    due = part.due[part.shown]
    return float(due[-1] - due[0]) / (len(due) - 1) / 2 if len(due) > 1 else None


def _part(context: Context, recording: Recording) -> Part:
    flags = context.flags
    version = flags["message-set"] if flags["message-set"] != "auto" else message_versions.version_of(recording)
    own = (Path(path) for path in os.environ.get("DODO_ODVD", "").split(os.pathsep) if path)
    part = select(
        recording,
        message_versions.load(version, *own),
        round(flags["max-gap"] * MICROSECONDS),
        start=flags["start"],
        end=flags["end"],
        timemod=flags["timemod"],
        messages=flags["messages"],
        without=flags["without"],
        camera=flags["video-sender"] if flags["video"] else None,
    )
    seconds = part.due[-1] / MICROSECONDS
    _log.info("playing %d messages and %d pictures in %.1f s", part.sent.sum(), part.shown.sum(), seconds)
    return part


def _memories(context: Context, recording: Recording, part: Part) -> Memories:
    """Those for the pictures, that in argb first; none if there are none to show."""
    flags = context.flags
    if not flags["video"]:
        return ()
    if not part.shown.any():
        _log.warning(
            "%s has no pictures of sender %d in the selected part: no memory is created",
            recording.path,
            flags["video-sender"],
        )
        return ()
    frame = first_frame(recording, part.rows[part.shown])
    width, height = frame.width, frame.height
    formats: tuple[str, ...] = pixels.FORMATS
    if width % 2 or height % 2:
        _log.warning("pictures of %d x %d pixels cannot be converted to I420", width, height)
        formats = tuple(kind for kind in formats if kind != "i420")
    return memories(context, width, height, formats)
