"""Tests that have no answer, as something around them broke: their outcome, and why in a sentence."""

import traceback

from dodo_dsl.outcome import Outcome
from dodo_dsl.plan.model import Plan
from dodo_dsl.run.backends import Job
from dodo_dsl.run.decision import Finding, outcome_of
from dodo_dsl.run.protocol import BackendError

LOG = "logs/runner.log"
"""In a test's report: where a fault of DoDo's own lies."""
_MOST_LETTERS = 300


def without_answer(plan: Plan, backend: str, why: str) -> Outcome:
    """The outcome of a test that never began."""
    return outcome_of(plan, Finding("error", why), backend, plan.cid)


def reason(job: Job, error: Exception) -> str:
    """Why a test has no answer, in a sentence."""
    why = cause(job, error)
    return f"this machine cannot run the test: {why}" if isinstance(error, OSError) else why


def cause(job: Job, error: Exception) -> str:
    """What an error says; where a fault of DoDo's lies stands in a log beside the test's own."""
    if isinstance(error, BackendError):
        return str(error)
    if isinstance(error, OSError):
        return without_number(error)
    log = job.report / LOG
    try:
        log.parent.mkdir(parents=True, exist_ok=True)
        with log.open("a", encoding="utf-8", errors="replace") as file:
            traceback.print_exception(error, file=file)
        more = f" ({LOG} has more)"
    except OSError:
        more = ""
    said = " ".join(str(error).split())[:_MOST_LETTERS]
    return f"a fault of DoDo itself: {type(error).__name__}: {said}{more}"


def without_number(error: OSError) -> str:
    place = f"{error.filename}: " if error.filename else ""
    return f"{place}{error.strerror or error}"
