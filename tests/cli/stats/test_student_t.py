"""Quantiles against SciPy's."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from dodo_dsl.cli.stats import student_t_quantile


@given(st.floats(0.5, 0.9999), st.integers(1, 200))
@pytest.mark.thorough
def test_quantiles(probability: float, freedom: int) -> None:
    assert student_t_quantile(probability, freedom) == pytest.approx(
        stats.t.ppf(probability, freedom), rel=1e-6, abs=1e-9
    )
