"""What the drives of a search say: how often the test fails, by which conditions, and at worst."""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from dodo_dsl.search.space import Space
from dodo_dsl.search.store import Drive

VERSION = 1
CONFIDENCE = 0.95
_NUMBER = re.compile(r"[-+]?\d+(\.\d+)?")


@dataclass(frozen=True)
class Influence:
    """How much a range of numbers matters: Spearman's rank correlation of its value with the margin, in [-1, 1]."""

    name: str
    correlation: float
    values: str


@dataclass(frozen=True)
class SearchFailure:
    """Drives that ended for the same reason but for its numbers; ``worst`` has the least margin."""

    kind: str
    drives: int
    worst: Drive


@dataclass(frozen=True)
class Shrunk:
    """A failure at values as near to the nominal ones as it was found at; ``changed`` are those that differ.

    ``failed`` is how many of its ``repeats`` drives failed for its reason. ``spec`` is the name of the test that has
    these values, empty if it does not fail each time.
    """

    kind: str
    reason: str
    values: Mapping[str, str]
    changed: tuple[str, ...]
    failed: int
    repeats: int
    spec: str


@dataclass(frozen=True)
class Findings:
    """Of a sweep; ``rate`` is the share of ``judged`` drives that failed, with the ends of its interval.

    ``proposed`` are the judged drives at the ends of ranges, where failures are expected, so that they count in no
    rate. ``errors`` are drives without an answer, which are left out, and ``left_out`` has their reasons. ``worst`` is
    None if no drive was judged.
    """

    test: str
    seed: int
    nominal: Drive | None
    judged: int
    failed: int
    errors: int
    proposed: int
    proposed_failed: int
    rate: float | None
    low: float
    high: float
    influences: tuple[Influence, ...]
    worst: Drive | None
    failures: tuple[SearchFailure, ...]
    left_out: tuple[SearchFailure, ...]
    ended_early: bool = False
    shrunk: tuple[Shrunk, ...] = ()


def kind_of(reason: str) -> str:
    """A reason without its numbers."""
    return _NUMBER.sub("#", reason)


def is_alike(one: Drive, other: Drive) -> bool:
    """Whether drives failed in the same way: the same checks, or for the same reason where one names none.

    So a car that hits one wall fails like one that hits the other, where values are nearer to the nominal ones.
    """
    if one.outcome != other.outcome:
        return False
    if one.checks and other.checks:
        return one.checks == other.checks
    return kind_of(one.reason) == kind_of(other.reason)


def find(
    test: str,
    seed: int,
    space: Space,
    nominal: Drive | None,
    swept: Sequence[Drive],
    proposed: Sequence[Drive] = (),
    ended_early: bool = False,
) -> Findings:
    """What the drives of a sweep and those at the ends of ranges say."""

    def of(drives: Sequence[Drive], *outcomes: str) -> list[Drive]:
        return [drive for drive in drives if drive.outcome in outcomes]

    others = [drive for drive in proposed if drive.values not in [one.values for one in swept]]
    judged, further = of(swept, "passed", "failed"), of(others, "passed", "failed")
    failed, left_out = of(swept, "failed"), of([*swept, *others], "error")
    low, high = interval(len(failed), len(judged))
    return Findings(
        test,
        seed,
        nominal,
        judged=len(judged),
        failed=len(failed),
        errors=len(left_out),
        proposed=len(further),
        proposed_failed=len(of(further, "failed")),
        rate=len(failed) / len(judged) if judged else None,
        low=low,
        high=high,
        influences=tuple(sorted(_influences(space, judged), key=lambda one: -abs(one.correlation))),
        worst=min((*judged, *further), key=_margin, default=None),
        failures=tuple(failures_of([*failed, *of(further, "failed")])),
        left_out=tuple(failures_of(left_out)),
        ended_early=ended_early,
    )


def interval(failed: int, judged: int) -> tuple[float, float]:
    """Clopper and Pearson's interval of a rate."""
    if not judged:
        return 0.0, 1.0
    from scipy.stats import binomtest

    found = binomtest(failed, judged).proportion_ci(CONFIDENCE, "exact")
    return float(found.low), float(found.high)


def _margin(drive: Drive) -> float:
    return -1.0 if drive.margin is None else drive.margin


def failures_of(failed: Sequence[Drive]) -> list[SearchFailure]:
    """Failed drives by the kinds of their reasons, the most frequent first."""
    kinds: dict[str, list[Drive]] = {}
    for drive in failed:
        kinds.setdefault(kind_of(drive.reason), []).append(drive)
    found = [SearchFailure(kind, len(group), min(group, key=_margin)) for kind, group in kinds.items()]
    return sorted(found, key=lambda failure: -failure.drives)


def _influences(space: Space, judged: Sequence[Drive]) -> Iterator[Influence]:
    from scipy.stats import spearmanr

    margins = [_margin(drive) for drive in judged]
    for one in space.ranges:
        if not one.is_list:
            numbers = [float(one.number(drive.values[one.name])) for drive in judged]
            is_known = len(set(margins)) > 1 and len(set(numbers)) > 1
            yield Influence(one.name, float(spearmanr(numbers, margins).statistic) if is_known else 0.0, one.text)


def document(findings: Findings) -> dict[str, Any]:
    """The contents of ``search.json``."""
    return {"dodo": "search", "version": VERSION, "confidence": CONFIDENCE, **asdict(findings)}


def lines(findings: Findings) -> Iterator[str]:
    """The findings as text."""
    yield ""
    if findings.nominal and findings.nominal.outcome != "passed":
        yield f"at the nominal values: {findings.nominal.outcome}, {findings.nominal.reason}"
    if findings.rate is None:
        yield "no drive was judged"
    else:
        yield (
            f"{findings.failed} of {findings.judged} drives failed: {findings.rate:.2%}, "
            f"{CONFIDENCE:.0%} interval {findings.low:.2%} to {findings.high:.2%}"
        )
    if findings.ended_early:
        yield "a failure ended the search"
    if findings.proposed:
        yield f"{findings.proposed_failed} of {findings.proposed} further drives failed at the ends of ranges"
    yield from (f"error {group.drives} x: {group.kind}" for group in findings.left_out)
    for one in findings.influences:
        yield f"{one.name}: rank correlation with the margin {one.correlation:+.2f}"
    if findings.worst:
        yield f"worst margin {findings.worst.margin or 0.0:.3f}: {_values(findings.worst)}"
    for failure in findings.failures:
        yield f"failed {failure.drives} x: {failure.kind}"
        yield f"  at worst: {_values(failure.worst)} (drive {failure.worst.number})"
    for shrunk in findings.shrunk:
        away = ", ".join(f"{name} {shrunk.values[name]}" for name in shrunk.changed)
        yield f"the simplest failure of its kind: {away or 'all values nominal'}"
        yield f"  {shrunk.reason}"
        few = f"only {shrunk.failed} of {shrunk.repeats} drives failed so: no test is written"
        yield f"  as a test: {shrunk.spec}" if shrunk.spec else f"  {few}"


def _values(drive: Drive) -> str:
    return ", ".join(f"{name} {text}" for name, text in drive.values.items())
