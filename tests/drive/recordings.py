"""Runs of shipped tests with the example application, and their recordings judged again."""

import io
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dodo_dsl.cli.main import main
from dodo_dsl.opendlv.envelope import Envelope
from dodo_dsl.opendlv.message_set import MessageSet
from services.base.lockstep_clock import EPOCH
from services.base.recorded_clock import read_steps
from tests.drive.applications import dodo, results

MESSAGES = MessageSet.standard()


@dataclass(frozen=True)
class Runs:
    """The report of a run of several tests."""

    report: Path
    tests: dict[str, dict[str, Any]]

    def recording(self, slug: str) -> Path:
        return self.report / slug / "test.rec"

    def checks(self, slug: str) -> dict[str, float]:
        """The values by name."""
        return {check["name"]: check["value"] for check in self.tests[slug]["checks"]}

    def evidence(self, slug: str) -> dict[str, Any]:
        (verdict,) = self.tests[slug]["verdicts"]
        return dict(verdict["evidence"])

    def messages(self, slug: str, name: str, sender_stamp: int = 0) -> list[tuple[float, int, Any]]:
        """What evaluators got of a message: seconds since the begin, sample time in us, the message."""
        found: list[Envelope] = [
            envelope
            for step in read_steps(self.recording(slug), MESSAGES)
            for envelope in step.messages
            if (envelope.data_type, envelope.sender_stamp) == (MESSAGES.id(name), sender_stamp)
        ]
        return [((e.sample_time - EPOCH) / 1e6, e.sample_time, MESSAGES.decode(e.data_type, e.payload)) for e in found]


def run(report: Path, *words: str) -> Runs:
    """Run tests that the example application passes."""
    dodo("run", *words, "-j", "2", "--report", str(report), code=0)
    return Runs(report, results(report))


def judged(code: int, *words: str | Path) -> dict[str, Any]:
    """What ``dodo judge --json`` says, in this process."""
    out, err = io.StringIO(), io.StringIO()
    assert main(["judge", *map(str, words), "--json"], out, err) == code, out.getvalue() + err.getvalue()
    document: dict[str, Any] = json.loads(out.getvalue())
    return document
