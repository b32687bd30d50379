"""Services of an application start in the order of their ``depends_on``, as processes and on a real engine."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from dodo_dsl.plan.model import ApplicationService
from dodo_dsl.run.backends import Job
from tests.docker.compose import Crate, changed, new_crate
from tests.run.faults import MARKS
from tests.run.helpers import BEGUN, PASS, READY, STARTED, WAIT

APP = "assert all(os.path.exists('/tmp/' + name) for name in {}), os.listdir('/tmp')\n" + STARTED + WAIT
HEALTHY, COMPLETED = "service_healthy", "service_completed_successfully"
MADE = "sleep 1; touch /tmp/$0; "
CHECK = {"interval": "200ms", "timeout": "5s", "retries": 3}
CONDITION = tuple[str, str, dict[str, Any]]
OTHERS: dict[str, CONDITION] = {
    "init": (COMPLETED, MADE + "exit 0", {}),
    "db": (
        HEALTHY,
        MADE + "sleep 600",
        {"healthcheck": {**CHECK, "retries": 300, "test": ["CMD", "test", "-f", "/tmp/db"]}},
    ),
    "plain": ("service_started", "touch /tmp/$0; sleep 600", {}),
}
ILL: dict[str, Any] = {"healthcheck": {**CHECK, "test": ["CMD", "false"]}}
TABLE: dict[str, tuple[dict[str, CONDITION], str, str]] = {
    "come-true": ({}, "passed", "it drove"),
    "init-fails": ({"init": (COMPLETED, "exit 3", {})}, "failed", "'init' ended with exit code 3 during set-up"),
    "without-check": ({"db": (HEALTHY, "sleep 600", {})}, "error", "nor the image of 'db' has a healthcheck"),
    "own-health": (
        {"app": ("", "", {"entrypoint": ["sleep", "600"], "command": [], **ILL})},
        "error",
        "'app' could not be started: its healthcheck failed",
    ),
}


def waiting(crate: Crate, slug: str, others: Mapping[str, CONDITION]) -> Job:
    """A test whose application waits for other services, each with a condition, a script and keys."""
    judge = READY + BEGUN + "time.sleep(2)\n" + PASS  # of a busy engine, too, the begin comes by then
    marks = [name for name, (_, script, _) in others.items() if "touch" in script]
    job = crate.job(slug, judge, APP.format(marks), timeout_s=30.0)
    application, others = job.plan.application, dict(others)
    app = application.compose["services"]["app"]
    shared = {key: app[key] for key in ("image", "volumes", "stop_grace_period", "depends_on", "ipc")}
    containers = {"app": app | others.pop("app", ("", "", {}))[2]}
    for name, (_, script, keys) in others.items():
        containers[name] = {**shared, "entrypoint": ["sh", "-c", script.replace("$", "$$"), name], **keys}
    after = {name: condition for name, (condition, _, _) in others.items()}
    services = (
        replace(application.services[0], after=after),
        *(ApplicationService(name, ("sh", "-c", script, name)) for name, (_, script, _) in others.items()),
    )
    made = replace(application, folder="../..", services=services, compose={"services": containers})
    return changed(job, replace(job.plan, application=made))


NO_CHECK: dict[str, CONDITION] = {"db": ("service_healthy", "sleep 600", {})}
"""Of processes: who has started is healthy."""


@pytest.mark.parametrize(
    ("backend", "names"),
    [
        pytest.param("process", ("come-true", "init-fails"), marks=MARKS["process"]),
        pytest.param("docker", ("come-true", "without-check", "own-health"), marks=MARKS["docker"]),
        pytest.param("mixed", ("come-true",), marks=MARKS["mixed"]),
    ],
)
def test_conditions(
    backend: str,
    names: tuple[str, ...],
    request: pytest.FixtureRequest,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """One that cannot come true ends the test, and names who waits for what."""
    monkeypatch.setenv("DODO_LEASES", str(tmp_path / "leases"))
    others, crate = {**OTHERS, **NO_CHECK}, new_crate(tmp_path)
    if backend != "process":
        request.getfixturevalue("images")
        others, crate = OTHERS, request.getfixturevalue("crate")
    jobs = [waiting(crate, name, {**others, **TABLE[name][0]}) for name in names]
    outcomes = crate.run(*jobs, backend=backend)
    for name in names:
        assert outcomes[name].outcome == TABLE[name][1] and TABLE[name][2] in outcomes[name].reason, outcomes[name]
