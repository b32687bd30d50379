"""Growth and fit against enumerated orders and SciPy."""

import itertools
from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from dodo_dsl.cli.stats import averaged, fit, in_order

_LOOP = ("virtual-camera", "dynamic-model", "integrator", "collision")
_OPEN = ("virtual-camera", "beacon", "continuous-signal")
THESIS: dict[str, tuple[str, ...]] = {
    "sil-open-straight": _OPEN,
    "sil-closed-straight": _LOOP,
    "sil-open-left-curve": _OPEN,
    "sil-closed-left-curve": _LOOP,
    "sil-closed-kiwi-track": _LOOP,
    "dil-static-rig": ("rec-replay", "continuous-signal"),
    "dil-kiwi-track": ("rec-replay", "continuous-signal"),
    "hil-camera": ("camera", "object-detection"),
    "hil-dynamic": ("camera", "dynamic-model", "integrator", "gantry", "collision"),
}
"""Table 5.1 of the thesis that architecture.md cites: its nine tests in its order, with their services."""
STATED = (0.66, 0.78, 0.63, 0.92)
"""What it states of the curve: a, which can only be ln a, and b with its interval."""
TESTS = st.lists(st.lists(st.sampled_from("abcdef"), min_size=1), min_size=1, max_size=5)


def test_services_count_once() -> None:
    assert in_order([("a", "b"), ("b", "b"), ("c", "a")]) == [2.0, 2.0, 3.0]


@given(TESTS)
@pytest.mark.thorough
def test_the_mean_is_that_over_all_orders(tests: list[list[str]]) -> None:
    every = [in_order(order) for order in itertools.permutations(tests)]
    assert averaged(tests) == pytest.approx(np.mean(every, axis=0))


@pytest.mark.parametrize("counts", [(2, 3, 3), (2, 3, 4, 4), (3, 6, 6, 6, 6, 7, 7, 9, 10)])
def test_the_line_is_that_of_scipy(counts: Sequence[float]) -> None:
    power = fit(counts)
    assert power
    line = stats.linregress(np.log(np.arange(1, len(counts) + 1)), np.log(counts))
    wide = stats.t.ppf(0.975, len(counts) - 2)
    assert (power.b, power.ln_a) == pytest.approx((line.slope, line.intercept))
    assert np.diff(power.b_interval)[0] == pytest.approx(2 * wide * line.stderr)
    assert np.diff(power.ln_a_interval)[0] == pytest.approx(2 * wide * line.intercept_stderr)


def test_two_tests_have_no_interval() -> None:
    assert fit((2, 3)) is None


def curves(tests: tuple[tuple[str, ...], ...]) -> set[tuple[int, ...]]:
    """The different curves of all orders of tests."""
    found: set[tuple[int, ...]] = {()}
    states: dict[tuple[tuple[int, ...], frozenset[str]], set[tuple[int, ...]]] = {}
    states[tuple(range(len(tests))), frozenset()] = found
    for _ in tests:
        following: dict[tuple[tuple[int, ...], frozenset[str]], set[tuple[int, ...]]] = {}
        for (left, seen), before in states.items():
            for test in left:
                now = seen.union(tests[test])
                key = tuple(other for other in left if other != test), now
                following.setdefault(key, set()).update((*curve, len(now)) for curve in before)
        states = following
    return set().union(*states.values())


@pytest.mark.thorough
def test_no_order_of_the_thesis_gives_its_figures() -> None:
    table = tuple(THESIS.values())
    assert tuple(in_order(table)) == (3, 6, 6, 6, 6, 7, 7, 9, 10)
    mean = fit(averaged(table))
    assert mean and (round(mean.b, 2), *(round(end, 2) for end in mean.b_interval)) == (0.50, 0.41, 0.60)
    every = curves(table)
    assert tuple(in_order(table)) in every and len(every) == 908
    fits = {
        (round(power.ln_a, 2), round(power.b, 2), round(power.b_interval[0], 2), round(power.b_interval[1], 2))
        for power in map(fit, every)
        if power
    }
    assert (1.24, 0.43, 0.26, 0.60) in fits
    assert STATED not in fits
