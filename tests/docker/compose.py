"""Tests of small scripts in containers: compose files written by hand, as the compiler would lay them out."""

import asyncio
import contextlib
import json
import os
import secrets
import subprocess
import sys
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from dodo_dsl import __version__
from dodo_dsl.outcome import Outcome
from dodo_dsl.plan.model import LAYERS, Flag, Plan
from dodo_dsl.plan.plan_json import to_json
from dodo_dsl.run.backends import CombinedBackends, Job
from dodo_dsl.run.runner import Runner
from dodo_dsl.run.schedule import Schedule
from tests.run.desk import ROOT
from tests.run.helpers import READY, STARTED, WAIT, Bench, Recorded

IMAGE = f"dodo/base:{__version__}"
SANDBOX_IMAGE = f"dodo/sandbox:{__version__}"
ODD = "a$HOMEb#c%20 'ü\""
"""The name of a folder; of colons engines want none."""
MEMORY = {"type": "tmpfs", "device": "tmpfs", "o": "mode=1777"}
SUBNETS = [f"10.213.{third}.{fourth}/28" for third in range(240, 256) for fourth in range(0, 256, 16)]


@dataclass
class Crate:
    """Makes tests whose slugs begin with ``mark``, by which all that an engine holds of them is found."""

    bench: Bench
    mark: str
    progress: Recorded = field(default_factory=Recorded)

    def job(
        self,
        slug: str,
        judge: str = READY + WAIT,
        application: str = WAIT,
        environment: str = READY + WAIT,
        timeout_s: float = 300.0,
        report: Path | None = None,
        **app: Any,
    ) -> Job:
        """A test of three scripts; ``app`` are keys of the application's service in its compose file."""
        plan = self.bench.plan(judge, STARTED + application, environment, f"{self.mark}-{slug}", timeout_s)
        camera, evaluator = plan.services
        access = replace(plan.application.access, paths=(str(self.bench.folder),))
        after = {"sandbox": {"condition": "service_started"}, "judge": {"condition": "service_healthy"}}
        flags = {"command": ["--cid=111", "--name=video0.argb"], "ipc": "service:sandbox", "depends_on": after}
        services = {"app": {**self._service(plan, "app"), **flags, **app}}
        plan = replace(
            plan,
            services=(
                replace(camera, image=IMAGE, flags=(Flag("rec", "test.rec", "report"),)),
                replace(evaluator, image=IMAGE),
            ),
            sandbox_image=SANDBOX_IMAGE,
            application=replace(plan.application, access=access, compose={"services": services}),
        )
        folder = self.bench.folder / "compiled" / plan.slug
        folder.mkdir(parents=True)
        for layer in LAYERS[:-1]:
            content = self._compose(plan) if layer == LAYERS[0] else {"services": {}}
            (folder / f"{layer}.compose.yml").write_text(json.dumps(content))
        return changed(Job(plan, folder, (report or self.bench.folder / "report") / plan.slug), plan)

    def _service(self, plan: Plan, name: str) -> dict[str, Any]:
        return {
            "image": IMAGE,
            "entrypoint": ["python3", "-u", f"{self.bench.folder}/{plan.slug}-{name}.py"],
            "volumes": [f"{self.bench.folder}:{self.bench.folder}:ro", "tmp:/tmp"],
            "init": True,
            "stop_grace_period": "1s",
        }

    def _compose(self, plan: Plan) -> dict[str, Any]:
        camera, judge = (self._service(plan, name) for name in ("camera", "judge"))
        camera["volumes"] += ["report:/dodo/report", "channel:/dodo/channel"]
        camera["environment"] = {"DODO_CHANNEL": "/dodo/channel"}
        sandbox = {
            "image": SANDBOX_IMAGE,
            "command": ["sleep", "infinity"],
            "init": True,
            "ipc": "shareable",
            "volumes": ["tmp:/tmp"],
        }
        return {
            "services": {"camera": camera, "judge": judge, "sandbox": sandbox},
            "networks": {"default": {"ipam": {"config": [{"subnet": "${DODO_SUBNET:-10.213.240.0/28}"}]}}},
            "volumes": {"tmp": {}, "report": {}, "channel": {"driver_opts": MEMORY}},
        }

    def run(self, *jobs: Job, backend: str = "docker") -> dict[str, Outcome]:
        """The outcomes by slug without the mark, all at once."""
        backends = CombinedBackends(backend, subnets=SUBNETS)
        runner = Runner(self.progress, backends, Schedule(len(jobs)))
        with contextlib.closing(backends):
            return {o.slug.removeprefix(f"{self.mark}-"): o for o in asyncio.run(runner.run(jobs))}

    def start(self, job: Job, *flags: str, **variables: str) -> "subprocess.Popen[str]":
        """``dodo run`` of one test."""
        words = ["run", "--backend", "docker", "--compiled", str(job.folder), "--report", str(job.report.parent)]
        return subprocess.Popen(
            [sys.executable, "-m", "dodo_dsl", *words, *flags],
            cwd=ROOT,
            env={**os.environ, "DODO_LEASES": str(self.bench.folder / "leases"), **variables},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )

    def log(self, slug: str, service: str = "app") -> str:
        """What a service of a test's application logged."""
        logs = self.bench.folder / "report" / f"{self.mark}-{slug}" / "logs"
        return (logs / f"application.{service}.log").read_text()

    def left(self) -> list[str]:
        """Containers, networks and volumes of these tests, and leases.

        Without a network that the engine itself has lost count of: old ones keep the endpoint of a container that ended
        while it was stopped, and refuse to remove its network until they are started anew. DoDo keeps its record then.
        """
        names = [name for words in _LISTS for name in _docker(*words) if f"dodo-{self.mark}-" in name]
        lost = {name for name in names if _is_lost(name)}
        kept = {name.removesuffix("_default") for name in lost}
        records = [path.name for path in (self.bench.folder / "leases").glob("*.lease")]
        records = [name for name in records if not any(f"-{project}." in name for project in kept)]
        return [name for name in names if name not in lost] + records


def changed(job: Job, plan: Plan) -> Job:
    """The job with another plan, which its folder has."""
    (job.folder / "test.json").write_text(to_json(plan))
    return replace(job, plan=plan)


def new_crate(folder: Path) -> Crate:
    """One with a mark that is like no other."""
    folder.chmod(0o777)
    return Crate(Bench(folder), f"fault-{secrets.token_hex(3)}")


_LISTS = (
    ("ps", "-a", "--format", "{{.Names}}"),
    ("network", "ls", "--format", "{{.Name}}"),
    ("volume", "ls", "--format", "{{.Name}}"),
)


def _is_lost(name: str) -> bool:
    """Whether a network has no container, and yet cannot be removed."""
    words = ["docker", "network", "inspect", name, "--format", "{{len .Containers}}"]
    counted = subprocess.run(words, capture_output=True, text=True, check=False).stdout.strip()
    if counted != "0":
        return False
    refused = subprocess.run(["docker", "network", "rm", name], capture_output=True, text=True, check=False).stderr
    return "has active endpoints" in refused


def _docker(*words: str) -> list[str]:
    return subprocess.run(["docker", *words], capture_output=True, text=True, check=True).stdout.splitlines()
