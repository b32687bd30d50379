"""What a recording holds, as far as a test needs it, by the index of its first 64 MiB."""

import functools
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from dodo_dsl.opendlv import regular_file
from dodo_dsl.opendlv.address import IMAGE
from dodo_dsl.opendlv.assets.problem import InputError

if TYPE_CHECKING:
    from dodo_dsl.opendlv.recording import Recording

MOST_BYTES = 64 << 20
_HINT = "expected an OpenDLV recording (.rec), as cluon-rec and rec-recorder write it"


@dataclass(frozen=True)
class Contents:
    """The number of messages of each id and sender in a file of ``size`` bytes, and what is wrong with it.

    ``is_whole`` means that it is known to have no others.
    """

    size: int
    counts: dict[tuple[int, int], int]
    picture: tuple[int, int]
    """Width and height of the first picture, 0 and 0 without any."""
    is_whole: bool
    fault: str
    damage: str

    def senders(self, message: int) -> list[int]:
        return sorted(sender for id_, sender in self.counts if id_ == message)


def contents(path: Path) -> Contents:
    """What a recording holds, nothing for what is none; raises OSError."""
    with regular_file.opened(path):
        return _contents(path, path.stat().st_mtime_ns)


@functools.lru_cache(maxsize=64)
def _contents(path: Path, _changed_ns: int) -> Contents:
    import numpy as np

    from dodo_dsl.opendlv import recording_times
    from dodo_dsl.opendlv.message_set import OWN_IDS
    from dodo_dsl.opendlv.recording import Recording, RecordingError

    try:
        with Recording(path, most=MOST_BYTES) as recording:
            index = recording.index
            keys, counts = np.unique(index[["data_type", "sender_stamp"]], return_counts=True)
            rows = np.flatnonzero(~np.isin(index["data_type"], list(OWN_IDS)))
            return Contents(
                recording.size,
                dict(zip(keys.tolist(), counts.tolist(), strict=True)),
                _picture(recording),
                recording.size <= MOST_BYTES and not recording.damage,
                recording_times.fault(recording, rows),
                str(recording.damage.places[0]) if recording.damage else "",
            )
    except RecordingError:
        return Contents(path.stat().st_size, {}, (0, 0), False, "", "")


def _picture(recording: "Recording") -> tuple[int, int]:
    from dodo_dsl.opendlv.frame_decoder import image_of

    images = map(image_of, recording.envelopes(recording.rows([IMAGE])[:1]))
    return next(((image.width, image.height) for image in images), (0, 0))


def picture_size(path: Path) -> tuple[int, int]:
    """Width and height of the first picture, 0 and 0 without any, or of a file that cannot be read."""
    try:
        return contents(path).picture
    except OSError:
        return 0, 0


def problems(path: Path, message: int, sender: int, name: str, is_needed: bool) -> Iterator[InputError]:
    """What is wrong with a recording, of which a message of a sender is used.

    Without ``is_needed`` there may be none, but then of no other sender either.
    """
    try:
        found = contents(path)
    except OSError as error:
        yield InputError(path, f"cannot be read as a recording: {error.strerror}")
        return
    if not found.counts:
        yield InputError(path, f"not a recording to play: its {found.size} bytes hold no message", hint=_HINT)
        return
    cut, senders = "'dodo rec cut' writes a part without it", found.senders(message)
    if found.damage:
        what = f"the recording has damage, which is passed over: {found.damage}"
        yield InputError(path, what, hint=cut, is_slip=True)
    if found.fault:
        yield InputError(path, f"the recording cannot be played: {found.fault}", hint=cut)
    if found.size <= MOST_BYTES and sender not in senders and (senders or is_needed):
        what = f"the recording has no {name} of sender {sender}, but of {', '.join(map(str, senders)) or 'none'}"
        yield InputError(path, what, hint="'dodo rec info' shows them")
