"""Pictures that services make: for OpenDLV's readers in shared memory, and for people in a PNG file."""

import json
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any, TextIO

import numpy as np

from dodo_dsl.opendlv import pixels
from dodo_dsl.opendlv.shared_memory import SharedMemory
from services.base.service import Context

Memories = Sequence[tuple[SharedMemory, str]]
"""Each with the format of ``pixels`` of its pictures."""


def memories(context: Context, width: int, height: int, formats: Iterable[str] = pixels.FORMATS) -> Memories:
    """New ones for pictures of a size in pixels, those that ``--name.FORMAT`` names; raises SharedMemoryError."""
    names = {kind: context.flags[f"name.{kind}"] for kind in formats}
    return [(context.memory(name, pixels.size(kind, width, height)), kind) for kind, name in names.items() if name]


def show(memories: Memories, argb: pixels.Picture, i420: pixels.Picture | None, time: int) -> None:
    """Copy a picture into each memory and stamp it under the lock, in us, then notify readers."""
    pictures = pixels.with_copies(argb, i420, (kind for _, kind in memories))
    for memory, kind in memories:
        if kind in pictures:
            picture = np.ascontiguousarray(pictures[kind])
            with memory.lock():
                memory.buffer[: picture.nbytes] = picture.data.cast("B")
                memory.stamp(time)
            memory.notify_all()


def png(picture: pixels.Picture) -> bytes:
    """The file of a picture of blue, green and red; raises OSError."""
    import cv2

    done, data = cv2.imencode(".png", picture)
    if not done:
        raise OSError(f"a picture of {picture.shape[1]} x {picture.shape[0]} pixels cannot be encoded")
    return data.tobytes()


OUTPUT = "--output="


def snapshot(
    argv: Sequence[str], stdout: TextIO, take: Callable[[list[str]], tuple[pixels.Picture, dict[str, Any]]]
) -> int:
    """Write what ``take`` makes of the words as the PNG of ``--output``, and print its facts, width and height.

    Exit codes: 0 done, 1 the picture cannot be taken or written, 2 the words are wrong; ``error`` says why. ``take``
    may raise ValueError for these, OSError and RuntimeError.
    """
    code = 0
    outputs = [word.removeprefix(OUTPUT) for word in argv if word.startswith(OUTPUT)]
    try:
        if len(outputs) != 1:
            raise ValueError(f"expected {OUTPUT}FILE once: the PNG to write")  # noqa: TRY301
        picture, facts = take([word for word in argv if not word.startswith(OUTPUT)])
        Path(outputs[0]).write_bytes(png(picture[..., :3]))
        result = {**facts, "width": picture.shape[1], "height": picture.shape[0]}
    except (ValueError, OSError, RuntimeError) as error:
        result, code = {"ok": False, "error": " ".join(str(error).split())}, 2 if isinstance(error, ValueError) else 1
    stdout.write(json.dumps(result) + "\n")
    return code
