"""Plans of small scripts: real processes in real sandboxes, without a camera or a car."""

import asyncio
import contextlib
import random
import socket
import textwrap
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

from dodo_dsl.outcome import Outcome
from dodo_dsl.plan.model import Application, ApplicationService, Plan, PlannedService
from dodo_dsl.run.backends import CombinedBackends, Job
from dodo_dsl.run.runner import Runner
from dodo_dsl.run.schedule import Schedule
from tests.run import scripted

READY = 'print(\'{"dodo": "ready"}\', flush=True)\n'
PASS = 'print(\'{"dodo": "verdict", "outcome": "passed", "reason": "it drove", "checks": []}\', flush=True)\n'
FAIL = 'print(\'{"dodo": "verdict", "outcome": "failed", "reason": "hit wall left", "checks": []}\', flush=True)\n'
WAIT = "import time; time.sleep(600)\n"
_STARTED = '"/tmp/" + sys.argv[0].rpartition("-")[0].replace("/", "_") + "-started"'
STARTED = f'open({_STARTED}, "w").close()\n'
"""What an application does first, so that others, by AFTER_START or BEGUN, go on only when the test has begun."""
AFTER_START = f"""
while not os.path.exists({_STARTED}):
    time.sleep(0.02)
"""
BEGUN = AFTER_START + "time.sleep(1)\n"
DRIVES = READY + BEGUN + "time.sleep(1)\n" + PASS


@contextlib.contextmanager
def reserved_cids(count: int) -> Iterator[range]:
    """Neighbouring CIDs that no other test on this machine uses at the same time, as the fixture ``cid`` has one."""
    for first in random.sample(range(2, 111 - count), 109 - count):
        with contextlib.ExitStack() as stack:
            leases = [stack.enter_context(socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)) for _ in range(count)]
            try:
                for number, lease in enumerate(leases, first):
                    lease.bind(f"\0dodo-test-cid-{number}")
            except OSError:
                continue
            yield range(first, first + count)
            return
    raise AssertionError(f"no {count} CIDs are free")


@dataclass
class Recorded:
    """A Progress that remembers its calls."""

    notes: list[str] = field(default_factory=list)
    phases: list[tuple[str, str]] = field(default_factory=list)

    def __enter__(self) -> "Recorded":
        return self

    def __exit__(self, *_: object) -> None:
        pass

    def note(self, text: str) -> None:
        self.notes.append(text)

    def phase(self, slug: str, text: str) -> None:
        self.phases.append((slug, text))

    def done(self, outcome: Outcome) -> None:
        self.phases.append((outcome.slug, outcome.outcome))


@dataclass
class Bench:
    """A folder in which tests are made of scripts and run."""

    folder: Path
    isolation: str | None = None
    progress: Recorded = field(default_factory=Recorded)

    def script(self, name: str, text: str) -> tuple[str, ...]:
        path = self.folder / f"{name}.py"
        path.write_text(textwrap.dedent(text))
        return ("python", str(path))

    def plan(
        self,
        judge: str = READY + "time.sleep(0.3)\n" + PASS,
        application: str = WAIT,
        environment: str = READY + WAIT,
        slug: str = "test",
        timeout_s: float = 10.0,
        command: tuple[str, ...] = ("--cid=111", "--name=video0.argb"),
    ) -> Plan:
        """One service a layer; the application is in its own, and takes CID and memory by default."""
        prefix = "import os, sys, time\n"
        services = (
            PlannedService("environment", "camera", "x", "x", self.script(f"{slug}-camera", prefix + environment)),
            PlannedService("evaluation", "judge", "x", "x", self.script(f"{slug}-judge", prefix + judge), judge=True),
        )
        app = ApplicationService(
            "app",
            self.script(f"{slug}-app", prefix + application),
            command,
            takes_cid=any("--cid" in w for w in command),
            takes_memory=any("--name" in w for w in command),
        )
        application = Application("..", (app,))
        return scripted.plan(slug, seed=0, timeout_s=timeout_s, services=services, application=application)

    def jobs(self, *plans: Plan) -> list[Job]:
        (self.folder / "compiled").mkdir(exist_ok=True)
        return [Job(plan, self.folder / "compiled", self.folder / "report" / plan.slug) for plan in plans]

    def run(self, *plans: Plan, parallel: int = 4, backends: CombinedBackends | None = None) -> list[Outcome]:
        """The outcomes; on the host with CIDs that no other test uses."""
        with reserved_cids(len(plans)) as cids:
            backends = backends or CombinedBackends("process", cids, isolation=self.isolation)
            if self.isolation == "host":
                plans = tuple(replace(plan, cid=cids[0]) for plan in plans)
            self.runner = Runner(self.progress, backends, Schedule(parallel))
            with contextlib.closing(backends):
                return asyncio.run(self.runner.run(self.jobs(*plans)))

    def log(self, plan: Plan, name: str) -> str:
        return (self.folder / "report" / plan.slug / "logs" / f"{name}.log").read_text()
