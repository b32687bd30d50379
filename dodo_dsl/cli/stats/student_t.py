"""Quantiles of Student's t distribution for whole degrees of freedom."""

import math


def quantile(probability: float, freedom: int) -> float:
    """The value that t exceeds with 1 - ``probability``, for a probability from 0.5 to below 1, by bisection."""
    low, high = 0.0, 1.0
    while _cumulative(high, freedom) < probability:
        high *= 2
    while (middle := (low + high) / 2) not in (low, high):
        low, high = (middle, high) if _cumulative(middle, freedom) < probability else (low, middle)
    return low


def _cumulative(t: float, freedom: int) -> float:
    """The share below t >= 0: Abramowitz and Stegun, Handbook of Mathematical Functions, 26.7.3 and 26.7.4."""
    angle = math.atan(t / math.sqrt(freedom))
    cosine, sine = math.cos(angle), math.sin(angle)
    is_odd = freedom % 2 == 1
    term = cosine if is_odd else 1.0
    total = 0.0
    for step in range(2 + is_odd, freedom + 1, 2):
        total += term
        term *= cosine**2 * (step - 1) / step
    inner = 2 / math.pi * (angle + sine * total) if is_odd else sine * total
    return (1 + inner) / 2
