from dodo_dsl.opendlv.messages.message_set import MessageSet
from services.camera.telemetry import Report

PERIOD = 100_000


def told(report: Report, pictures: str, start: int = 0) -> list[tuple[int, int, int]]:
    """Instant, sender stamp and code of each message; a dot is an instant without a picture."""
    said = []
    for number, letter in enumerate(pictures, start):
        for output in report.say(letter != ".", number * PERIOD):
            said.append((number, output.sender_stamp, output.message.code))
    return said


def test_at_first_and_on_each_change() -> None:
    report = Report(MessageSet.standard(), 4, 2 * PERIOD)
    assert told(report, "x.x" + 10 * "." + "...x..") == [(0, 4, 0), (13, 4, 1), (16, 4, 0)]


def test_a_slow_camera_is_not_missed_between_two_pictures() -> None:
    report = Report(MessageSet.standard(), 4, 20 * PERIOD)
    assert told(report, "x" + 19 * "." + "x") == [(0, 4, 0)]


def test_without_a_stamp_nothing_is_said() -> None:
    assert told(Report(MessageSet.standard(), None, 0), "x" + 30 * ".") == []
