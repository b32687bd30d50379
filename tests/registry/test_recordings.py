"""The script beside the committed recordings makes these again."""

import importlib.util
import math
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from dodo_dsl.opendlv.envelope import Envelope
from dodo_dsl.opendlv.message_set import MessageSet
from dodo_dsl.opendlv.recording import read_envelopes
from dodo_dsl.opendlv.video import VideoDecoder

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("recordings")]

COMMITTED = Path(__file__).parents[2] / "tests_registry" / "recordings"
MESSAGES = MessageSet.standard()
IMAGE = MESSAGES.id("opendlv.proxy.ImageReading")
NAMES = ("static-rig", pytest.param("kiwi-track", marks=pytest.mark.proof))
LEAST_PSNR = 45.0  # dB; another processor or libx264 may choose other bits


def load() -> ModuleType:
    spec = importlib.util.spec_from_file_location("make_recordings", COMMITTED / "make_recordings.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """Makes the recording of a name, once."""
    folder = tmp_path_factory.mktemp("recordings")

    @cache
    def make(name: str) -> Path:
        load().make(folder, (name,))
        return folder / f"{name}.rec"

    return make


def head(envelope: Envelope) -> tuple[int, int, int]:
    return envelope.data_type, envelope.sender_stamp, envelope.sample_time


def values(envelope: Envelope) -> dict[str, Any]:
    """What a message says; a picture's bytes are compared as a picture instead."""
    message = MESSAGES.decode(envelope.data_type, envelope.payload)
    return {field.name: getattr(message, field.name) for field in message.DESCRIPTOR.fields if field.name != "data"}


def pictures(envelopes: list[Envelope]) -> list[NDArray[np.uint8]]:
    decoder = VideoDecoder("h264")
    frames = [decoder.decode(MESSAGES.decode(IMAGE, e.payload).data) for e in envelopes if e.data_type == IMAGE]
    assert None not in frames
    return [frame.pixels("i420") for frame in frames if frame is not None]


def psnr(one: NDArray[np.uint8], other: NDArray[np.uint8]) -> float:
    error = float(np.mean((one.astype(np.float32) - other) ** 2))
    return math.inf if error == 0 else 10 * math.log10(255**2 / error)


@pytest.mark.parametrize("name", NAMES)
def test_messages_are_those_of_the_committed_recording(made: Callable[[str], Path], name: str) -> None:
    again, committed = (list(read_envelopes(path)) for path in (made(name), COMMITTED / f"{name}.rec"))
    assert len(committed) > 50
    assert [head(e) for e in again] == [head(e) for e in committed]
    for one, other in zip(again, committed, strict=True):
        expected = {k: pytest.approx(v, abs=1e-5) if isinstance(v, float) else v for k, v in values(other).items()}
        assert values(one) == expected


@pytest.mark.parametrize("name", NAMES)
def test_pictures_are_those_of_the_committed_recording(made: Callable[[str], Path], name: str) -> None:
    again, committed = (pictures(list(read_envelopes(path))) for path in (made(name), COMMITTED / f"{name}.rec"))
    assert len(committed) >= 50
    quality = [psnr(one, other) for one, other in zip(again, committed, strict=True)]
    assert min(quality) >= LEAST_PSNR, f"picture {int(np.argmin(quality))} has {min(quality):.1f} dB"
