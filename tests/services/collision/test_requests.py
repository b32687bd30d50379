import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.collision.model import REQUESTS, Requests

SECOND = 1_000_000


@given(st.lists(st.integers(0, 20 * SECOND), max_size=20), st.floats(0.1, 10), st.integers(0, 5 * SECOND))
def test_the_longest_silence_against_numpy(times: list[int], most: float, rest: int) -> None:
    requests = Requests(max_silence=most)
    for time in sorted(times):
        requests.take(REQUESTS[0], time)
    end = max(times, default=0) + rest
    fault = requests.fault(end, 0)
    (check,) = requests.checks()
    if not times:
        assert (check.value, check.ok, fault) == (None, False, None)
        return
    longest = np.diff(np.sort([*times, end])).max() / SECOND
    assert check.value == pytest.approx(longest) and check.ok == (longest <= most)
    assert (fault is not None) == (rest > most * SECOND)


def test_silence_before_the_first_request_and_before_the_begin_does_not_count() -> None:
    requests = Requests(max_silence=2.0)
    assert requests.fault(50 * SECOND, 0) is None and requests.is_silent
    requests.take(REQUESTS[0], None)
    assert requests.fault(60 * SECOND, 0) is None
    requests.forget(70 * SECOND)
    assert requests.fault(72 * SECOND, 0) is None and requests.fault(73 * SECOND, 0) is not None
