"""The filter is whole, or there is none."""

import pytest

from dodo_dsl.run.process import seccomp_filter


@pytest.fixture(autouse=True)
def afresh() -> None:
    seccomp_filter.program.cache_clear()


def test_it_is_a_program_for_the_kernel() -> None:
    assert len(seccomp_filter.program()) % 8 == 0
    assert len(seccomp_filter.program()) > 8 * len(seccomp_filter._REFUSED)


def test_a_call_that_cannot_be_filtered_is_an_error_and_not_allowed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(seccomp_filter, "_REFUSED", ("mount", "call_of_the_future"))
    with pytest.raises(seccomp_filter.NoSeccomp, match="does not know the system call call_of_the_future"):
        seccomp_filter.program()
