"""dodo judge: judge the recording of a test again, also by other limits."""

import argparse
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, TextIO

from dodo_dsl.cli import display, selection
from dodo_dsl.cli.errors import Exit, UsageError, files_of_the_user
from dodo_dsl.cli.run_jobs import compile_tests
from dodo_dsl.diagnostics import Piece
from dodo_dsl.outcome import Outcome, Result
from dodo_dsl.plan.model import Plan
from dodo_dsl.report import checks, results
from dodo_dsl.run.judge import Judgement, judge
from dodo_dsl.run.protocol import Finding, VerdictEvent
from dodo_dsl.run.test_recording import TestRecording, inspect
from dodo_dsl.spec.load import Settings
from dodo_dsl.terminal import json_text, printable


def known_run(recording: Path) -> Outcome | None:
    """The run whose report holds a recording, from ``results.json`` above its folder; None if there is none."""
    folder = recording.resolve().parent
    try:
        outcomes = results.load(folder.parent / results.FILE_NAME)
    except results.ResultsError:
        return None
    return next((outcome for outcome in outcomes if outcome.slug == folder.name), None)


VERSION = 1


def as_pieces(plan: Plan, recording: TestRecording, judgement: Judgement) -> Iterator[Piece]:
    """The verdict as ``dodo run`` prints it, with all checks, in parts for colours."""
    finding = judgement.finding
    clock = "lockstep" if recording.clock == "lockstep" else "real time"
    yield f"{recording.path}: {recording.duration_s:.1f} s in {clock}\n", ""
    yield f"{finding.result.upper():<7}", display.OF_OUTCOMES[finding.result]
    lines = [
        f" {plan.name}  {printable(finding.reason)}",
        *(f"        note: {printable(note)}" for note in judgement.notes),
        *(f"        | {printable(line)}" for line in judgement.last_lines),
    ]
    for verdict in judgement.verdicts:
        lines += ["", f"{printable(verdict.service)} {'passed' if verdict.passed else 'failed'}", *_checks(verdict)]
        lines += [f"  {key:<16} {_text(value)}" for key, value in verdict.evidence.items()]
    yield "\n".join(lines) + "\n", ""


def as_json(plan: Plan, recording: TestRecording, judgement: Judgement) -> str:
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
        "notes": judgement.notes,
        "last_lines": judgement.last_lines,
    }
    return json_text(document)


def _checks(verdict: VerdictEvent) -> Iterator[str]:
    for check in verdict.checks:
        unit = f" {check['unit']}" if check["unit"] else ""
        limits = ", ".join(checks.limits(check))
        value = "none" if check["value"] is None else f"{_text(check['value'])}{unit}"
        margin = check.get("margin")
        margin_text = "" if margin is None else f", margin {_text(margin)}{unit}"
        said = f"{value}{f' ({limits})' if limits else ''}{margin_text}"
        yield f"  {printable(check['name']):<16} {said}{'' if check['ok'] else '  broken'}"


def _text(value: object) -> str:
    if value is None:
        return "none"
    return f"{value:.6g}" if isinstance(value, float) else printable(str(value))


EXAMPLES = """examples:
  dodo judge dodo-report/sil-closed-straight/test.rec --spec sil-closed-straight
  dodo judge test.rec --spec my-limits/my-limits.dodo.yml      by the limits of another spec
  dodo judge test.rec --spec 'sil-perception[light=1,clutter=0]'
  dodo judge dodo-report/sil-open-straight/test.rec --spec sil-open-straight --json

Every run leaves the recording of each test in its report. The evaluators of the spec get its messages in test time: in
lockstep the verdict is the same, bit for bit; in real time it can differ where single updates decide.

exit codes: 0 passed, 1 failed, 2 wrong usage, spec or recording, 3 error: there is no verdict
"""

_EXITS: dict[Result, Exit] = {"passed": Exit.OK, "failed": Exit.PROBLEMS, "error": Exit.ERROR}


def add(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("file", type=Path, metavar="FILE.rec", help="recording of a test, test.rec in its report")
    parser.add_argument(
        "--spec", metavar="SPEC", required=True, help="name, instance or spec of the test by which it is judged"
    )
    parser.add_argument("--json", action="store_true", help="print the judgement as JSON")
    selection.add_application(parser)


def main(options: argparse.Namespace, stdout: TextIO, stderr: TextIO) -> int:
    with files_of_the_user():
        recording = inspect(options.file)
    run = known_run(options.file)
    with tempfile.TemporaryDirectory(prefix="dodo-judge-") as name:
        work = Path(name).resolve()
        plan, folder = _plan(options, run, work / "compiled", stderr if options.json else stdout)
        if recording.fault:
            judgement = Judgement(Finding("error", f"the recording cannot be judged: {recording.fault}"), ())
        else:
            (work / "files").mkdir()
            cid = run.cid if run and run.slug == plan.slug else plan.cid
            judgement = judge(plan, folder, recording, cid, work / "files")
    if run and run.slug != plan.slug:
        judgement = replace(judgement, notes=(f"the recording is of another test, {run.name}", *judgement.notes))
    if options.json:
        stdout.write(as_json(plan, recording, judgement))
    else:
        display.write_coloured(stdout, as_pieces(plan, recording, judgement))
    return _EXITS[judgement.finding.result]


def _plan(options: argparse.Namespace, run: Outcome | None, out: Path, notes: TextIO) -> tuple[Plan, Path]:
    """The Plan by which to judge, and the folder of the compiled test; raises UsageError.

    Of several tests it is the one that the recording is of.
    """
    words = argparse.Namespace(test=[options.spec], level=[], application=options.application, backend=None)
    plans, _, _ = compile_tests(words, Settings(), out, notes)
    for plan in plans:
        if len(plans) == 1 or (run is not None and plan.slug == run.slug):
            return plan, out / plan.slug
    names = "', '".join(plan.name for plan in plans[:3])
    raise UsageError(f"'{options.spec}' means {len(plans)} tests, expected one, such as '{names}'")
