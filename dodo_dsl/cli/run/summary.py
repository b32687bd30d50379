"""The summary at the end of a run."""

from collections.abc import Mapping, Sequence
from typing import TextIO

from dodo_dsl.cli.run.progress import count, summary_line
from dodo_dsl.outcome import Outcome
from dodo_dsl.terminal import printable

_KINDS = ("passed", "failed", "error")


def write(stream: TextIO, outcomes: Sequence[Outcome], tests: Mapping[str, str], skipped: Sequence[str]) -> None:
    """One line per test with its explanation, then the counts; ``tests`` has each slug's name without repetition."""
    stream.write("\n")
    width = max((len(outcome.name) for outcome in outcomes), default=0)
    for outcome in outcomes:
        stream.write(summary_line(outcome, width) + "\n")
        stream.writelines(f"        note: {printable(note)}\n" for note in outcome.notes)
        if outcome.outcome != "passed":
            stream.writelines(f"        | {printable(line)}\n" for line in outcome.last_lines)
    stream.write("\n")
    if len(set(tests.values())) < len(tests):
        stream.writelines(f"{line}\n" for line in _rates(outcomes, tests))
    counts = {kind: sum(o.outcome == kind for o in outcomes) for kind in _KINDS}
    stream.write(f"{counts['passed']} passed, {counts['failed']} failed, {counts['error']} in error\n")
    if skipped:
        stream.write(
            f"{count(len(skipped))} not started: {printable(', '.join(skipped[:5]))}{' ...' * (len(skipped) > 5)}\n"
        )


def _rates(outcomes: Sequence[Outcome], tests: Mapping[str, str]) -> list[str]:
    """How often each repeated test passed."""
    lines = []
    for test in dict.fromkeys(tests.values()):
        runs = [o.outcome for o in outcomes if tests[o.slug] == test]
        passed = runs.count("passed")
        rate = f" ({passed / len(runs):.1%})" if runs else ""
        lines.append(f"{printable(test)}: {passed} of {len(runs)} passed{rate}")
    return lines
