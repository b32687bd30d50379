"""dodo judge: judge the recording of a test again, also by other limits."""

import argparse
import shutil
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import TextIO

from dodo_dsl.cli import selection
from dodo_dsl.cli.display import colours
from dodo_dsl.cli.errors import UsageError, files_of_the_user
from dodo_dsl.cli.exits import Exit
from dodo_dsl.cli.judge.known_run import KnownRun, known_run
from dodo_dsl.cli.judge.output import as_json, as_pieces
from dodo_dsl.cli.run.jobs import compile_tests, load_compiled
from dodo_dsl.outcome import Result
from dodo_dsl.plan.model import Plan
from dodo_dsl.plan.recorder_service import RECORDING
from dodo_dsl.report.report_folder import Drawable, write_report
from dodo_dsl.run.outcomes import Finding, outcome_of
from dodo_dsl.run.recorded.judge import LOGS, Judgement, judge
from dodo_dsl.run.recorded.test_recording import TestRecording, inspect
from dodo_dsl.spec.settings import Settings
from dodo_dsl.terminal import printable

EXAMPLES = """examples:
  dodo judge dodo-report/sil-closed-straight/test.rec --spec sil-closed-straight
  dodo judge test.rec --spec my-limits/my-limits.dodo.yml      by the limits of another spec
  dodo judge test.rec --spec 'sil-perception[light=1,clutter=0]'
  dodo judge dodo-report/sil-open-straight/test.rec --compiled generated/sil-open-straight --json
  dodo judge test.rec --spec my-limits/my-limits.dodo.yml --report judged      and a page that replays it

Every run leaves the recording of each test in its report. The evaluators of the spec get its messages in test time: in
lockstep the verdict is the same, bit for bit; in real time it can differ where single updates decide.

exit codes: 0 passed, 1 failed, 2 wrong usage, spec or recording, 3 error: there is no verdict
"""

_EXITS: dict[Result, Exit] = {"passed": Exit.OK, "failed": Exit.PROBLEMS, "error": Exit.ERROR}


def add(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("file", type=Path, metavar="FILE.rec", help="recording of a test, test.rec in its report")
    source = parser.add_mutually_exclusive_group(required=True)
    source.add_argument("--spec", metavar="SPEC", help="name, instance or spec of the test by which it is judged")
    source.add_argument(
        "--compiled", type=Path, metavar="DIR/SLUG", help="folder of a compiled test, instead of a spec"
    )
    parser.add_argument("--json", action="store_true", help="print the judgement as JSON")
    parser.add_argument(
        "--report", type=Path, metavar="DIR", help="new folder for a report, whose page replays the drive as judged now"
    )
    selection.add_application(parser)


def main(options: argparse.Namespace, stdout: TextIO, stderr: TextIO) -> int:
    with files_of_the_user():
        recording = inspect(options.file)
    run = known_run(options.file)
    if options.report and options.report.exists():
        raise UsageError(f"--report: '{options.report}' is there already, expected a new folder")
    with tempfile.TemporaryDirectory(prefix="dodo-judge-") as name:
        work = Path(name).resolve()
        plan, folder = _plan(options, run, work / "compiled", stderr if options.json else stdout)
        if recording.fault:
            judgement = Judgement(Finding("error", f"the recording cannot be judged: {recording.fault}"), ())
            return _told(options, plan, recording, judgement, run, stdout)
        (work / "files").mkdir()
        cid = run.cid if run and run.slug == plan.slug else plan.cid
        judgement = judge(plan, folder, recording, cid, work / "files")
        if options.report:
            with files_of_the_user():
                problems = _write_report(options.report, Drawable(plan, folder), recording, judgement, cid)
            stderr.writelines(f"{printable(problem)}\n" for problem in problems)
    return _told(options, plan, recording, judgement, run, stdout)


def _write_report(folder: Path, test: Drawable, recording: TestRecording, judgement: Judgement, cid: int) -> list[str]:
    """The report of a judgement, with sentences on what could not be drawn; raises OSError."""
    place = folder / test.plan.slug
    place.mkdir(parents=True)
    shutil.copyfile(recording.path, place / RECORDING)
    if judgement.logs:
        shutil.copytree(judgement.logs, place / LOGS)
    outcome = replace(
        outcome_of(test.plan, judgement.finding, "process", cid),
        clock=recording.clock,
        checks=tuple(check for verdict in judgement.verdicts for check in verdict.checks),
        verdicts=tuple(verdict.as_json() for verdict in judgement.verdicts),
        notes=judgement.notes,
        last_lines=judgement.last_lines,
    )
    return write_report(folder, [outcome], {test.plan.slug: test})


def _told(
    options: argparse.Namespace,
    plan: Plan,
    recording: TestRecording,
    judgement: Judgement,
    run: KnownRun | None,
    stdout: TextIO,
) -> int:
    if options.json:
        stdout.write(as_json(plan, recording, judgement, run))
    else:
        colours.write(stdout, as_pieces(plan, recording, judgement, run))
    return _EXITS[judgement.finding.result]


def _plan(options: argparse.Namespace, run: KnownRun | None, out: Path, notes: TextIO) -> tuple[Plan, Path]:
    """The Plan by which to judge, and the folder of the compiled test; raises UsageError."""
    if options.compiled:
        if options.application:
            raise UsageError("--compiled judges by a test as it was compiled: --application does not apply")
        return load_compiled(options.compiled, Settings()), options.compiled.resolve()
    words = argparse.Namespace(test=[options.spec], level=[], application=options.application, backend=None)
    plans, _, _ = compile_tests(words, Settings(), out, notes)
    plan = _only(plans, run, options.spec)
    return plan, out / plan.slug


def _only(plans: list[Plan], run: KnownRun | None, word: str) -> Plan:
    """The test itself, or of several the one that the recording is of."""
    same = [plan for plan in plans if len(plans) == 1 or (run is not None and plan.slug == run.slug)]
    if same:
        return same[0]
    names = "', '".join(plan.name for plan in plans[:3])
    raise UsageError(f"'{word}' means {len(plans)} tests, expected one, such as '{names}'")
