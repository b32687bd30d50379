"""Shared by all services: flags from the manifest, the loop with its injected clock, readiness, verdicts."""

from services.base.clock import RealTimeClock
from services.base.evaluator import Evaluator, JudgedTime, UnjudgeableError
from services.base.flags import Flags, Share
from services.base.judged import Judged, JudgedBoxes, Series
from services.base.process import main, run
from services.base.service import Check, Context, Handler, Output, Service, UnusableMessageError, Verdict, period_of

__all__ = [
    "Check",
    "Context",
    "Evaluator",
    "Flags",
    "Handler",
    "Judged",
    "JudgedBoxes",
    "JudgedTime",
    "Output",
    "RealTimeClock",
    "Series",
    "Service",
    "Share",
    "UnjudgeableError",
    "UnusableMessageError",
    "Verdict",
    "main",
    "period_of",
    "run",
]
