import pytest

from services.gantry.service import LinkTelemetry


def test_jitter_is_the_distance_of_each_period_and_latency_that_of_the_answer() -> None:
    telemetry = LinkTelemetry(0.05)
    for began, answered in ((0.0, 0.01), (0.05, 0.07), (0.12, None), (0.17, 0.18)):
        telemetry.note(began, answered)
    assert telemetry.jitter == pytest.approx((0, 0.018, 0.02))
    assert telemetry.latency == pytest.approx((0.01, 0.019, 0.02))
    assert str(telemetry) == (
        "4 turns of 50 ms, 1 without an answer; jitter median 0.0 ms, 95 % 18.0 ms, max 20.0 ms; "
        "position after median 10.0 ms, 95 % 19.0 ms, max 20.0 ms"
    )


def test_nothing_was_measured() -> None:
    assert LinkTelemetry(0.05).jitter == LinkTelemetry(0.05).latency == (0, 0, 0)
