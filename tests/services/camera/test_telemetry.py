from dodo_dsl.opendlv.message_set import MessageSet
from services.camera.service import CameraTelemetry

PERIOD = 100_000


def told(telemetry: CameraTelemetry, pictures: str, start: int = 0) -> list[tuple[int, int, int]]:
    """Instant, sender stamp and code of each message; a dot is an instant without a picture."""
    result = []
    for number, letter in enumerate(pictures, start):
        for output in telemetry.update(letter != ".", number * PERIOD):
            result.append((number, output.sender_stamp, output.message.code))
    return result


def test_at_first_and_on_each_change() -> None:
    telemetry = CameraTelemetry(MessageSet.standard(), 4, 2 * PERIOD)
    assert told(telemetry, "x.x" + 10 * "." + "...x..") == [(0, 4, 0), (13, 4, 1), (16, 4, 0)]


def test_a_slow_camera_is_not_missed_between_two_pictures() -> None:
    telemetry = CameraTelemetry(MessageSet.standard(), 4, 20 * PERIOD)
    assert told(telemetry, "x" + 19 * "." + "x") == [(0, 4, 0)]


def test_without_a_stamp_nothing_is_said() -> None:
    assert told(CameraTelemetry(MessageSet.standard(), None, 0), "x" + 30 * ".") == []
