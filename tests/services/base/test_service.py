import os
from fractions import Fraction

import pytest

from dodo_dsl.opendlv.message_set import MessageSet
from dodo_dsl.opendlv.shared_memory import SharedMemory, SharedMemoryError
from services.base.flags import Flags
from services.base.service import Context, Service, period_of


@pytest.mark.parametrize(("slow", "fast"), [(30.0, 60.0), (15.0, 60.0), (12.0, 24.0), (29.97, 59.94), (0.3, 0.9)])
def test_multiples_of_a_rate_stay_aligned(slow: float, fast: float) -> None:
    one, other = period_of(slow), period_of(fast)
    times = round(fast / slow)
    assert all(round(n * one) == round(n * times * other) for n in range(0, 100_000, 7))


def test_no_period_is_shorter_than_a_microsecond() -> None:
    assert period_of(1e9) == Fraction(1)


def test_memory_is_removed_with_the_resources() -> None:
    context = Context("test", Flags({}), MessageSet.standard())
    name = f"dodo-test-{os.getpid()}-context"
    with context.resources:
        assert context.memory(name, 16).size == 16
        SharedMemory.attach(name).close()
    with pytest.raises(SharedMemoryError):
        SharedMemory.attach(name)


def test_a_service_needs_nothing_of_its_own() -> None:
    service = Service()
    service.begin(1)
    service.end_of_input(2)
    assert (tuple(service.update(1)), service.verdict, service.finished, service.drive) == ((), None, False, None)
