"""A judgement as text and as JSON."""

from collections.abc import Iterator
from typing import Any

from dodo_dsl.cli.display import colours
from dodo_dsl.cli.judge.known_run import KnownRun
from dodo_dsl.diagnostics import Piece
from dodo_dsl.plan.model import Plan
from dodo_dsl.report import check_words
from dodo_dsl.run.protocol import VerdictEvent
from dodo_dsl.run.recorded.judge import Judgement
from dodo_dsl.run.recorded.test_recording import TestRecording
from dodo_dsl.terminal import json_text, printable

VERSION = 1


def as_text(plan: Plan, recording: TestRecording, judgement: Judgement, run: KnownRun | None) -> str:
    """The verdict as ``dodo run`` prints it, with all checks, and how it differs from the run's."""
    return "".join(text for text, _ in as_pieces(plan, recording, judgement, run))


def as_pieces(plan: Plan, recording: TestRecording, judgement: Judgement, run: KnownRun | None) -> Iterator[Piece]:
    """The same text in parts, for colours."""
    finding = judgement.finding
    clock = "lockstep" if recording.clock == "lockstep" else "real time"
    yield f"{recording.path}: {recording.duration_s:.1f} s in {clock}\n", ""
    yield f"{finding.result.upper():<7}", colours.OF_OUTCOMES[finding.result]
    lines = [
        f" {plan.name}  {printable(finding.reason)}",
        *(f"        note: {printable(note)}" for note in _notes(plan, judgement, run)),
        *(f"        | {printable(line)}" for line in judgement.last_lines),
    ]
    for verdict in judgement.verdicts:
        lines += ["", f"{printable(verdict.service)} {'passed' if verdict.passed else 'failed'}", *_checks(verdict)]
        lines += [f"  {key:<16} {_text(value)}" for key, value in verdict.evidence.items()]
    yield "\n".join(lines) + "\n", ""


def as_json(plan: Plan, recording: TestRecording, judgement: Judgement, run: KnownRun | None) -> str:
    """The same as one object, its checks as in ``results.json``."""
    finding = judgement.finding
    document: dict[str, Any] = {
        "dodo": "judgement",
        "version": VERSION,
        "recording": str(recording.path),
        "clock": recording.clock,
        "duration": recording.duration_s,
        "name": plan.name,
        "slug": plan.slug,
        "spec": plan.spec,
        "outcome": finding.result,
        "reason": finding.reason,
        "checks": [check for verdict in judgement.verdicts for check in verdict.checks],
        "verdicts": [verdict.as_json() for verdict in judgement.verdicts],
        "notes": _notes(plan, judgement, run),
        "last_lines": judgement.last_lines,
    }
    return json_text(document)


def _notes(plan: Plan, judgement: Judgement, run: KnownRun | None) -> list[str]:
    return [*_comparison(plan, judgement, run), *judgement.notes]


def _comparison(plan: Plan, judgement: Judgement, run: KnownRun | None) -> Iterator[str]:
    """Whether the recording is of another test, and whether the run said something else."""
    if run is None:
        return
    outcome, finding = run.outcome, judgement.finding
    if run.slug != plan.slug:
        yield f"the recording is of another test, {outcome.name}"
    elif (outcome.outcome, outcome.reason) != (finding.result, finding.reason):
        yield f"the run said {outcome.outcome}: {outcome.reason}"


def _checks(verdict: VerdictEvent) -> Iterator[str]:
    for check in verdict.checks:
        unit = f" {check['unit']}" if check["unit"] else ""
        limits = ", ".join(check_words.limits(check))
        value = "none" if check["value"] is None else f"{_text(check['value'])}{unit}"
        margin = check.get("margin")
        margin_text = "" if margin is None else f", margin {_text(margin)}{unit}"
        said = f"{value}{f' ({limits})' if limits else ''}{margin_text}"
        yield f"  {printable(check['name']):<16} {said}{'' if check['ok'] else '  broken'}"


def _text(value: object) -> str:
    if value is None:
        return "none"
    return f"{value:.6g}" if isinstance(value, float) else printable(str(value))
