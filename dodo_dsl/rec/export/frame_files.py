"""The frames of a camera as pictures, a file each."""

from collections import Counter
from collections.abc import Callable
from pathlib import Path

from dodo_dsl.opendlv.messages.varints import Numbers
from dodo_dsl.opendlv.recordings.recording import Recording
from dodo_dsl.rec.frames import FramesError, decoded, write_picture


def names(recording: Recording, images: Numbers, picture_type: str) -> list[str]:
    """A file name for each image message: sender stamp and sample time in us, and a number where both are taken."""
    index, taken = recording.index[images], Counter[tuple[int, int]]()
    found = []
    for key in zip(index["sender_stamp"].tolist(), index["sampled"].tolist(), strict=True):
        taken[key] += 1
        number = f"-{taken[key]}" if taken[key] > 1 else ""
        found.append(f"{key[0]}-{key[1]}{number}.{picture_type}")
    return found


def write(
    recording: Recording,
    images: Numbers,
    picture_type: str,
    folder: Path,
    progress: Callable[[int], None],
    problem: Callable[[str], None],
) -> int:
    """Write each frame that can be decoded into ``folder``, as ``png`` or ``jpg``; returns how many they are.

    ``progress`` gets the number of packets done, ``problem`` a sentence about what cannot be decoded at all. Raises
    FramesError where that is all of them, and OSError.
    """
    written = 0
    pairs = zip(names(recording, images, picture_type), decoded(recording, images, problem), strict=True)
    for done, (name, (_, frame)) in enumerate(pairs, 1):
        if frame is not None:
            write_picture(folder / name, frame)
            written += 1
        progress(done)
    if not written:
        raise FramesError(f"no frame of {recording.path} can be decoded")
    return written
