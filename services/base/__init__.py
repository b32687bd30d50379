"""What all services share: flags from the manifest, the loop with its injected clock, readiness, verdicts."""

from services.base.clock import Clock, RealTimeClock
from services.base.flags import Flags, FlagsError
from services.base.service import Context, Handler, Output, Service, run
from services.base.verdict import Check, Verdict

__all__ = [
    "Check",
    "Clock",
    "Context",
    "Flags",
    "FlagsError",
    "Handler",
    "Output",
    "RealTimeClock",
    "Service",
    "Verdict",
    "run",
]
