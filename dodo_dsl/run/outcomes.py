"""From what happened in a test to its outcome: failed is the application's fault, error is anyone else's."""

import errno
import os
import signal
import traceback
from collections.abc import Mapping, Sequence
from pathlib import Path

from dodo_dsl import atomic
from dodo_dsl.check.wiring import ANYTHING
from dodo_dsl.outcome import Outcome, Result
from dodo_dsl.plan.added_services import FRAMES, RECORDER
from dodo_dsl.plan.model import DISPLAY_SERVER, ENDS_INPUT, Plan, PlannedService
from dodo_dsl.run.protocol import BackendError, Finding, Flooded, VerdictEvent
from dodo_dsl.spec.manifest import load_manifests

LOG = "logs/runner.log"
"""The traceback of an internal error, in the test's report."""
_RANK: dict[Result, int] = {"passed": 0, "failed": 1, "error": 2}
_MAX_ERROR_TEXT = 300
Verdicts = Mapping[str, Sequence[VerdictEvent]]
"""What each evaluator of a test has said, in the order of its spec."""


def outcome_of(plan: Plan, finding: Finding, backend: str, cid: int) -> Outcome:
    return Outcome(
        name=plan.name,
        slug=plan.slug,
        spec=plan.spec,
        description=plan.description,
        level=plan.level,
        kind=plan.kind,
        outcome=finding.result,
        reason=finding.reason,
        cid=cid,
        seed=plan.seed,
        clock=plan.clock,
        backend=backend,
        goals=plan.goals,
        headline=plan.headline,
        decided_by=finding.service if finding.cause == "verdict" and finding.result != "error" else "",
    )


def decide(plan: Plan, findings: Sequence[Finding], verdicts: Verdicts, others: Sequence[Finding] = ()) -> Finding:
    """The finding that decides: the first of the worst kind. Without a single verdict nothing passes.

    The evaluator that ends the drive (``until``) comes before the rest. ``others`` are findings that follow those of
    the evaluators, of whose kind none passes.
    """
    until = [s.name for s in plan.services if any(flag.name == ENDS_INPUT for flag in s.flags)]
    judged = [f for name in sorted(verdicts, key=lambda name: name not in until) for f in _judged(name, verdicts[name])]
    if not findings and not judged:
        return Finding("error", "no evaluator gave a verdict")
    every = [*findings, *judged, *others]
    first = max(every, key=lambda finding: _RANK[finding.result])
    if first.result != "passed" or len(every) == 1:
        return first
    passed = [finding for name in verdicts for finding in judged if finding.service == name]
    return Finding("passed", "; ".join(finding.reason for finding in passed), passed[0].service)


def _judged(evaluator: str, verdicts: Sequence[VerdictEvent]) -> list[Finding]:
    if len(verdicts) > 1:
        return [Finding("error", f"evaluator '{evaluator}' gave {len(verdicts)} verdicts, expected one", evaluator)]
    return [Finding("passed" if v.passed else "failed", v.reason, evaluator, "verdict", v.silent) for v in verdicts]


def error_outcome(plan: Plan, backend: str, reason: str) -> Outcome:
    return outcome_of(plan, Finding("error", reason), backend, plan.cid)


def describe(error: Exception, report: Path) -> str:
    """The text of an exception; the traceback of an internal error goes into LOG in the folder ``report``."""
    if isinstance(error, BackendError):
        return str(error)
    if isinstance(error, OSError):
        place = f"{error.filename}: " if error.filename else ""
        return f"this machine says: {place}{error.strerror or error}"
    log = report / LOG
    try:
        with atomic.appended(log) as file:
            file.write("".join(traceback.format_exception(error)).encode("utf-8", "replace"))
        more = f" (traceback in {LOG})"
    except OSError:
        more = ""
    text = " ".join(str(error).split())[:_MAX_ERROR_TEXT]
    return f"internal error: {type(error).__name__}: {text}{more}"


def unstartable(plan: Plan, service: str, why: str) -> Finding:
    """Of a service that could not be started; one by its path in the application's folder is built there."""
    programs = {own.name: own.process[0] for own in plan.application.services if own.process}
    program = programs.get(service, "")
    is_missing = why == f"{program}: {os.strerror(errno.ENOENT)}"
    hint = "; build it first" if is_missing and "/" in program and not Path(program).is_absolute() else ""
    if is_missing and program == DISPLAY_SERVER[0]:
        hint = "; its 'display' needs Xvfb: apt install xvfb xauth"
    path = Path(why.removesuffix(f": {os.strerror(errno.ENOENT)}"))
    if ".." in path.parts and path.exists():
        outside = Path(*path.parts[path.parts.index("..") :]).parent
        folder = outside.parent if outside.name == "bin" else outside
        hint = f"; it is there, but the test does not see it: write 'sandbox: {{read: [{folder}]}}' in dodo.yml"
    return Finding("error", f"service '{service}' could not be started: {why}{hint}", service)


def flooded(plan: Plan, event: Flooded) -> Finding:
    """The end of a test that sends more than its recorder takes; it is the application's where only that can have."""
    names = [service.name for service in plan.services if _may_send(service, event.message)]
    sender = f"service '{names[0]}' sends" if names else "only the application can have sent"
    part = f"{event.share:.0%} of it is {event.message}/{event.sender_stamp}, which {sender}"
    return Finding("failed" if event.too_fast and not names else "error", f"{event.what}: {part}", event.service)


def _may_send(service: PlannedService, message: str) -> bool:
    """Whether a service's manifest has the message; that of a deployment's own service is not known here."""
    if service.name == RECORDER:
        names = {flag.name for flag in service.flags}
        return message == FRAMES and "frames" in names and "pictures" not in names
    manifest = load_manifests()[0].get(service.uses)
    ports = manifest.all_messages.outputs if manifest else (ANYTHING,)
    return any(port.rstrip("?").partition("/")[0] in (message, ANYTHING) for port in ports)


def lost_messages(service: PlannedService, messages: int) -> str:
    """A sentence on a service whose receive buffer was full, and on what that means."""
    meaning = "it worked without them"
    if any(flag.kind == "report" for flag in service.flags):
        meaning = "the recording is incomplete"
    elif service.judge:
        meaning = "its verdict does not consider them"
    count = f"{messages} message{'s' * (messages != 1)}"
    return f"service '{service.name}' lost {count}, because its receive buffer was full: {meaning}"


def how_it_ended(code: int) -> str:
    """An exit code in words; negative codes and those above 128 are signals."""
    number = -code if code < 0 else code - 128
    if code < 0 or 128 < code < 160:
        try:
            name = signal.Signals(number).name
        except ValueError:
            name = f"signal {number}"
        return f"was killed by {name}"
    return f"ended with exit code {code}"
