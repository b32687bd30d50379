"""The summary at the end of a run."""

from collections.abc import Iterator, Mapping, Sequence
from typing import TextIO

from dodo_dsl.cli.display import colours
from dodo_dsl.cli.run.progress import count, summary_line
from dodo_dsl.diagnostics import Piece
from dodo_dsl.outcome import Outcome
from dodo_dsl.terminal import printable


def write(stream: TextIO, outcomes: Sequence[Outcome], tests: Mapping[str, str], skipped: Sequence[str]) -> None:
    """One line per test with its explanation, then the counts; ``tests`` has each slug's name without repetition."""
    stream.write("\n")
    width = max((len(outcome.name) for outcome in outcomes), default=0)
    for outcome in outcomes:
        colours.write(stream, summary_line(outcome, width))
        stream.writelines(f"        note: {printable(note)}\n" for note in outcome.notes)
        if outcome.outcome != "passed":
            stream.writelines(f"        | {printable(line)}\n" for line in outcome.last_lines)
    stream.write("\n")
    if len(set(tests.values())) < len(tests):
        stream.writelines(f"{line}\n" for line in _rates(outcomes, tests))
    colours.write(stream, _counts(outcomes))
    if skipped:
        stream.write(
            f"{count(len(skipped))} not started: {printable(', '.join(skipped[:5]))}{' ...' * (len(skipped) > 5)}\n"
        )


def _counts(outcomes: Sequence[Outcome]) -> Iterator[Piece]:
    """How many tests passed, failed and ended in error; what there is, in colour."""
    for between, kind, word in (("", "passed", "passed"), (", ", "failed", "failed"), (", ", "error", "in error")):
        number = sum(outcome.outcome == kind for outcome in outcomes)
        yield between, ""
        yield f"{number} {word}", colours.OF_OUTCOMES[kind] if number else ""
    yield "\n", ""


def _rates(outcomes: Sequence[Outcome], tests: Mapping[str, str]) -> list[str]:
    """How often each repeated test passed."""
    lines = []
    for test in dict.fromkeys(tests.values()):
        runs = [o.outcome for o in outcomes if tests[o.slug] == test]
        passed = runs.count("passed")
        rate = f" ({passed / len(runs):.1%})" if runs else ""
        lines.append(f"{printable(test)}: {passed} of {len(runs)} passed{rate}")
    return lines
