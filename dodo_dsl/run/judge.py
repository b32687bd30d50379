"""The evaluators of a test, as processes, on the recording of a test."""

import subprocess
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

from dodo_dsl.plan.model import Plan
from dodo_dsl.run import service_protocol
from dodo_dsl.run.outcomes import decide, how_it_ended
from dodo_dsl.run.process.commands import Commands
from dodo_dsl.run.process.confinement import Command
from dodo_dsl.run.process.slot import Slot
from dodo_dsl.run.protocol import Finding, Noted, VerdictEvent
from dodo_dsl.run.service_output import TAIL_LINES, TAIL_WIDTH
from dodo_dsl.run.test_recording import TestRecording

NOT_OF_A_RECORDING = ("DODO_READERS", "DODO_RIG", "DODO_WORLD", "DODO_TOLD", "DODO_TRUTH")


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
    services = [service for service in plan.services if service.judge]
    verdicts: dict[str, list[VerdictEvent]] = {service.name: [] for service in services}
    findings: list[Finding] = []
    notes: list[str] = []
    with ThreadPoolExecutor(len(services)) as pool, ExitStack() as stack:
        running = [stack.enter_context(_started(commands.of(service), recording)) for service in services]
        said = dict(zip(verdicts, pool.map(lambda process: process.communicate(), running), strict=True))
    for (name, (output, _)), process in zip(said.items(), running, strict=True):
        for line in output.splitlines():
            match service_protocol.read(name, True, line):
                case VerdictEvent() as verdict:
                    verdicts[name].append(verdict)
                case Finding() as finding:
                    findings.append(finding)
                case Noted(text):
                    notes.append(text)
        if process.returncode != 0:
            findings.append(Finding("error", f"evaluator '{name}' {how_it_ended(process.returncode)}", name))
        elif not verdicts[name] and not any(finding.service == name for finding in findings):
            text = f"the recording ends after {recording.duration_s:.1f} s, before evaluator '{name}' gave a verdict"
            findings.append(Finding("error", text, name))
    finding = decide(plan, findings, verdicts)
    last: list[str] = []
    if finding.result != "passed" and finding.service in said:
        last = said[finding.service][1].decode("utf-8", "replace").splitlines()[-TAIL_LINES:]
    last_lines = tuple(line[:TAIL_WIDTH] for line in last if line.strip())
    return Judgement(finding, tuple(v for each in verdicts.values() for v in each), tuple(notes), last_lines)


@contextmanager
def _started(command: Command, recording: TestRecording) -> Iterator["subprocess.Popen[bytes]"]:
    """An evaluator, which is killed at the end if it still runs."""
    kept = {name: value for name, value in command.environment.items() if name not in NOT_OF_A_RECORDING}
    environment = {**kept, "DODO_CLOCK": "recording", "DODO_RECORDING": str(recording.path.resolve())}
    process = subprocess.Popen(
        command.argv,
        env=environment,
        cwd=command.folder,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    try:
        yield process
    finally:
        process.kill()
        process.wait()
