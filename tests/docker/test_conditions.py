"""Services of an application start in the order of their ``depends_on``, as processes and on a real engine."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from dodo_dsl.plan.model import ApplicationService
from dodo_dsl.run import start_order
from dodo_dsl.run.backends import Job
from tests.docker.compose import Crate, changed, new_crate
from tests.run.faults import MARKS
from tests.run.helpers import BEGUN, PASS, READY, STARTED, WAIT

APP = "assert all(os.path.exists('/tmp/' + name) for name in {}), os.listdir('/tmp')\n" + STARTED + WAIT
HEALTHY, COMPLETED = "service_healthy", "service_completed_successfully"
MADE = "sleep 1; touch /tmp/$0; "
CHECK = {"interval": "200ms", "timeout": "5s", "retries": 3}
OTHERS: dict[str, tuple[str, str, dict[str, Any]]] = {
    "init": (COMPLETED, MADE + "exit 0", {}),
    "db": (
        HEALTHY,
        MADE + "sleep 600",
        {"healthcheck": {**CHECK, "retries": 300, "test": ["CMD", "test", "-f", "/tmp/db"]}},
    ),
    "plain": ("service_started", "touch /tmp/$0; sleep 600", {}),
}
CONDITION = tuple[str, str, dict[str, Any]]
ILL: dict[str, Any] = {"healthcheck": {**CHECK, "test": ["CMD", "false"]}}
TABLE: dict[str, tuple[dict[str, CONDITION], str, str]] = {
    "come-true": ({}, "passed", "it drove"),
    "init-fails": ({"init": (COMPLETED, "exit 3", {})}, "failed", "'init' ended with exit code 3 during set-up"),
    "optional": ({"init": (COMPLETED, "exit 3", {})}, "passed", "it drove"),
    "unhealthy": ({"db": (HEALTHY, "sleep 600", ILL)}, "error", "'app' could not be started: it waits for 'db'"),
    "ends-in-time": ({"db": (HEALTHY, "exit 0", OTHERS["db"][2])}, "failed", "'db' ended with exit code 0 during"),
    "without-check": ({"db": (HEALTHY, "sleep 600", {})}, "error", "nor the image of 'db' has a healthcheck"),
    "own-health": (
        {"app": ("", "", {"entrypoint": ["sleep", "600"], "command": [], **ILL})},
        "error",
        "'app' could not be started: its healthcheck failed",
    ),
    "never-ends": ({"init": (COMPLETED, "sleep 600", {})}, "error", "'init' to end with exit code 0 (depends_on), and"),
}


def waiting(crate: Crate, slug: str, others: Mapping[str, tuple[str, str, dict[str, Any]]], optional: bool) -> Job:
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
        replace(application.services[0], after=after, optional=("init",) if optional else ()),
        *(ApplicationService(name, ("sh", "-c", script, name)) for name, (_, script, _) in others.items()),
    )
    made = replace(application, folder="../..", services=services, compose={"services": containers})
    return changed(job, replace(job.plan, application=made))


NAMES = {
    "process": ("come-true", "init-fails", "optional", "never-ends"),
    "docker": ("come-true", "unhealthy", "ends-in-time", "without-check", "own-health"),
    "mixed": ("come-true", "init-fails"),
}
NO_CHECK: dict[str, CONDITION] = {"db": ("service_healthy", "sleep 600", {})}
"""Of processes: who has started is healthy."""


@pytest.mark.parametrize(
    ("backend", "names"),
    [pytest.param(backend, names, id=backend, marks=MARKS[backend]) for backend, names in NAMES.items()],
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
    if "never-ends" in names:
        monkeypatch.setattr(start_order, "LONGEST_S", 9.0)
    chosen = {name: TABLE[name] for name in names}
    jobs = [waiting(crate, slug, {**others, **row[0]}, slug == "optional") for slug, row in chosen.items()]
    outcomes = crate.run(*jobs, backend=backend)
    for slug, (_, expected, said) in chosen.items():
        assert (outcomes[slug].outcome, said in outcomes[slug].reason) == (expected, True), outcomes[slug].reason
    if "optional" in names:
        assert "service 'app' starts all the same: it waits for 'init'" in "".join(outcomes["optional"].notes)
