"""What a service that plays a recording can send, by its parameters and by what the recording holds."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from dodo_dsl.check import resolve
from dodo_dsl.check.wiring import message
from tests.run.recorded.made import MESSAGES, begin, write
from tests.run.recorded.made import message as envelope

STEERING, PEDAL = "opendlv.proxy.GroundSteeringRequest", "opendlv.proxy.PedalPositionRequest"
IDS = frozenset((name, MESSAGES.id(name)) for name in (STEERING, PEDAL))


def may_send(path: Path, port: str, **texts: str) -> bool:
    argument = SimpleNamespace(parameter=SimpleNamespace(format="recording"), value=SimpleNamespace(path=path))
    service: Any = SimpleNamespace(arguments={"rec": argument}, texts=texts)
    return resolve.may_send(service, message(port, None), IDS)


@pytest.mark.parametrize(
    ("port", "texts", "sends"),
    [
        (STEERING, {}, True),
        (f"{STEERING}/0", {}, True),
        (f"{STEERING}/3", {}, False),
        (PEDAL, {}, False),
        ("opendlv.proxy.TemperatureReading", {}, False),
        (STEERING, {"without": f"{PEDAL},{STEERING}"}, False),
        (f"{STEERING}/0", {"without": f"{STEERING}/0"}, False),
        (STEERING, {"without": f"{STEERING}/3"}, True),
        (STEERING, {"messages": PEDAL}, False),
        (STEERING, {"messages": f"{PEDAL},{STEERING}/0"}, True),
    ],
)
def test_what_a_recording_holds_and_the_test_lets_through(
    tmp_path: Path, port: str, texts: dict[str, str], sends: bool
) -> None:
    path = write(tmp_path / "some.rec", begin(), envelope(STEERING, 1, 1))
    assert may_send(path, port, **texts) is sends


def test_of_what_cannot_be_read_to_its_end_nobody_knows(tmp_path: Path) -> None:
    path = write(tmp_path / "cut.rec", begin())
    path.write_bytes(path.read_bytes() + b"\x0d\xa4 and no more")
    assert may_send(path, STEERING)
    assert may_send(tmp_path / "none.rec", STEERING)
