"""The evaluators of a test, as processes, on the recording of a test."""

import subprocess
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryFile
from typing import BinaryIO

from dodo_dsl.plan.model import Plan
from dodo_dsl.run import service_protocol
from dodo_dsl.run.outcomes import Facts, Finding, decide, how_it_ended
from dodo_dsl.run.process.commands import Commands
from dodo_dsl.run.process.confinement import Command
from dodo_dsl.run.process.slot import Slot
from dodo_dsl.run.protocol import Malformed, Noted, VerdictEvent
from dodo_dsl.run.test_recording import TestRecording

NOT_OF_A_RECORDING = ("DODO_READERS", "DODO_RIG", "DODO_WORLD", "DODO_TOLD", "DODO_TRUTH")
_TAIL_LINES, _TAIL_WIDTH = 8, 300


@dataclass(frozen=True)
class Judgement:
    """The finding that decides, the verdict of each evaluator, notes, and the last lines of the one that decided."""

    finding: Finding
    verdicts: tuple[VerdictEvent, ...]
    notes: tuple[str, ...] = ()
    last_lines: tuple[str, ...] = ()


def judge(plan: Plan, folder: Path, recording: TestRecording, cid: int, work: Path) -> Judgement:
    """Let the evaluators of a Plan judge; ``folder`` is the compiled test's, ``work`` an empty one for their files.

    ``cid`` is the one that verdicts name. Raises OSError where a program cannot be started.
    """
    commands = Commands(plan, folder, work, Slot(cid))
    facts = Facts(tuple(service.name for service in plan.services if service.judge))
    notes: list[str] = []
    tails: dict[str, tuple[str, ...]] = {}
    with ExitStack() as stack:
        services = [service for service in plan.services if service.judge]
        running = [stack.enter_context(_started(commands.of(each), recording, work)) for each in services]
        for name, (process, output, log) in zip(facts.evaluators, running, strict=True):
            code = process.wait()
            _collect(name, output, facts, notes)
            log.seek(0)
            last = log.read().splitlines()[-_TAIL_LINES:]
            tails[name] = tuple(line.decode("utf-8", "replace")[:_TAIL_WIDTH] for line in last if line.strip())
            _take_end(name, code, facts, recording)
    finding = decide(facts)
    verdicts = tuple(verdict for name in facts.evaluators for verdict in facts.verdicts.get(name, []))
    last_lines = tails.get(finding.service, ()) if finding.result != "passed" else ()
    return Judgement(finding, verdicts, tuple(notes), last_lines)


@contextmanager
def _started(
    command: Command, recording: TestRecording, work: Path
) -> Iterator[tuple["subprocess.Popen[bytes]", BinaryIO, BinaryIO]]:
    """An evaluator that is killed at the end, if it still runs, what it prints, and its log."""
    kept = {name: value for name, value in command.environment.items() if name not in NOT_OF_A_RECORDING}
    environment = {**kept, "DODO_CLOCK": "recording", "DODO_RECORDING": str(recording.path.resolve())}
    with TemporaryFile(dir=work) as output, TemporaryFile(dir=work) as log:
        process = subprocess.Popen(
            command.argv, env=environment, cwd=command.folder, stdin=subprocess.DEVNULL, stdout=output, stderr=log
        )
        try:
            yield process, output, log
        finally:
            process.kill()
            process.wait()


def _collect(name: str, output: BinaryIO, facts: Facts, notes: list[str]) -> None:
    output.seek(0)
    for line in output:
        match service_protocol.read(name, True, line):
            case VerdictEvent() as verdict:
                facts.verdicts.setdefault(name, []).append(verdict)
            case Malformed(_, problem):
                text = f"the verdict of evaluator '{name}' is malformed: {problem}"
                facts.findings.append(Finding("error", text, name))
            case Noted(text):
                notes.append(text)


def _take_end(name: str, code: int, facts: Facts, recording: TestRecording) -> None:
    if code != 0:
        facts.findings.append(Finding("error", f"evaluator '{name}' {how_it_ended(code)}", name))
    elif not facts.verdicts.get(name) and not any(finding.service == name for finding in facts.findings):
        text = f"the recording ends after {recording.duration_s:.1f} s, before evaluator '{name}' gave a verdict"
        facts.findings.append(Finding("error", text, name))
