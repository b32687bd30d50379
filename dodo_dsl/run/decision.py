"""From what happened in a test to its outcome: failed is the application's fault, error is anyone else's."""

import signal
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

from dodo_dsl.outcome import Outcome, Result
from dodo_dsl.plan.model import Plan, Service
from dodo_dsl.run.protocol import Verdict

_RANK: dict[Result, int] = {"passed": 0, "failed": 1, "error": 2}


@dataclass(frozen=True)
class Finding:
    """One thing that decides an outcome, and the service whose last lines explain it."""

    result: Result
    reason: str
    service: str = ""


def outcome_of(plan: Plan, finding: Finding, backend: str, cid: int) -> Outcome:
    """A test's outcome as far as plan and finding tell it; ``backend`` by its name."""
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
    )


@dataclass
class Facts:
    """What the engine saw: findings of its own, and the verdicts of each evaluator."""

    judges: tuple[str, ...]
    findings: list[Finding] = field(default_factory=list)
    verdicts: dict[str, list[Verdict]] = field(default_factory=dict)


def worst(results: Iterable[Result]) -> Result:
    """error > failed > passed."""
    return max(results, key=_RANK.__getitem__, default="error")


def decide(facts: Facts) -> Finding:
    """The finding that decides: the first of the worst kind. Without a single verdict nothing passes."""
    findings = [
        *facts.findings,
        *(f for judge in facts.judges for f in _judged(judge, facts.verdicts.get(judge, []))),
    ]
    if not findings:
        return Finding("error", "no evaluator gave a verdict")
    result = worst(f.result for f in findings)
    deciding = [f for f in findings if f.result == result]
    if result == "passed":
        return Finding("passed", "; ".join(f.reason for f in deciding), deciding[0].service)
    return deciding[0]


def _judged(judge: str, verdicts: Sequence[Verdict]) -> list[Finding]:
    if len(verdicts) > 1:
        return [Finding("error", f"evaluator '{judge}' gave {len(verdicts)} verdicts, expected one", judge)]
    return [Finding("passed" if v.passed else "failed", v.reason, judge) for v in verdicts]


def lost_messages(service: Service, messages: int) -> str:
    """A sentence on a service whose receive buffer was full, and on what that means."""
    meaning = "it worked without them"
    if any(flag.kind == "report" for flag in service.flags):
        meaning = "the recording is not complete"
    elif service.judge:
        meaning = "its verdict is about the others"
    count = f"{messages} message{'s' * (messages != 1)}"
    return f"service '{service.name}' lost {count}, as its receive buffer was full: {meaning}"


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
