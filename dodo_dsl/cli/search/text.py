"""The findings of a search as text."""

from collections.abc import Iterator

from dodo_dsl.search.findings import CONFIDENCE, Findings, Shrunk
from dodo_dsl.search.store import Drive
from dodo_dsl.terminal import printable


def lines(findings: Findings) -> Iterator[str]:
    yield ""
    if findings.nominal and findings.nominal.outcome != "passed":
        yield printable(f"at the nominal values: {findings.nominal.outcome}, {findings.nominal.reason}")
    yield from _rate(findings)
    if findings.influences:
        yield "what matters (rank correlation of value and margin):"
        width = max(len(one.name) for one in findings.influences)
        for one in findings.influences:
            yield printable(f"  {one.name:<{width}}  {one.correlation:+.2f}  {one.values}")
    if findings.worst:
        margin = findings.worst.margin or 0.0
        yield f"worst margin {margin:.3f}: {values(findings.worst)}"
        yield printable(f"  {findings.worst.outcome}: {findings.worst.reason}")
    for failure in findings.failures:
        yield printable(f"failed {failure.drives} x: {failure.kind}")
        yield f"  at worst: {values(failure.worst)} (drive {failure.worst.number})"
    for shrunk in findings.shrunk:
        yield from _shrunk(shrunk)


def _shrunk(shrunk: Shrunk) -> Iterator[str]:
    away = ", ".join(f"{name} {shrunk.values[name]}" for name in shrunk.changed)
    yield printable(f"the simplest failure of its kind: {away or 'all values nominal'}")
    yield printable(f"  {shrunk.reason}")
    if shrunk.spec:
        yield f"  as a test: {shrunk.spec}"
    else:
        yield f"  only {shrunk.failed} of {shrunk.repeats} drives failed so: no test is written"


def _rate(findings: Findings) -> Iterator[str]:
    if findings.rate is None:
        yield "no drive was judged"
    else:
        yield (
            f"{findings.failed} of {findings.judged} drives failed: {findings.rate:.2%}, "
            f"{CONFIDENCE:.0%} interval {findings.low:.2%} to {findings.high:.2%}"
        )
    if findings.ended_early:
        yield "a failure ended the search, so this rate says little"
    if findings.proposed:
        share = f"{findings.proposed_failed} of {findings.proposed}"
        yield f"{share} further drives failed, where failures were expected: they do not count in this rate"
    if findings.errors:
        yield f"{findings.errors} left out, which ended in error twice, or failed once and not again:"
        yield from (printable(f"  {group.drives} x: {group.kind}") for group in findings.left_out)


def values(drive: Drive) -> str:
    return printable(", ".join(f"{name} {text}" for name, text in drive.values.items()))
