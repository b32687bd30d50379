"""Faults around tests on each backend: the outcome, its sentence, nothing left, and an unharmed neighbour."""

import re
from collections.abc import Callable
from pathlib import Path

import pytest

from dodo_dsl.outcome import Outcome
from dodo_dsl.run import engine
from tests.docker.compose import Crate
from tests.docker.conftest import crate, images  # noqa: F401
from tests.faults import Book
from tests.images.conftest import base_image, built  # noqa: F401
from tests.run.desk import gone
from tests.run.faults import Fault, as_told, by_backend, whole_logs
from tests.run.helpers import STARTED, WAIT, Bench

Run = Callable[[str, dict[str, Fault]], dict[str, Outcome]]
NEVER_READY = Fault(
    "A service never gets ready", "error", "service 'camera' was not ready within 2 s", (), environment=WAIT
)


@pytest.fixture
def bench(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Bench:
    """On the host, where more can be left than in namespaces."""
    monkeypatch.setenv("DODO_LEASES", str(tmp_path / "leases"))
    return Bench(tmp_path, "host")


@pytest.fixture
def run(bench: Bench, request: pytest.FixtureRequest) -> Run:
    """Runs all faults at once on a backend, each a test, which leaves nothing, and gives their outcomes."""

    def on(backend: str, faults: dict[str, Fault]) -> dict[str, Outcome]:
        if backend != "process":
            request.getfixturevalue("images")
            made: Crate = request.getfixturevalue("crate")
            jobs = [made.job(slug, f.judge, f.application, f.environment, **f.app) for slug, f in faults.items()]
            return made.run(*jobs, backend=backend)
        plans = [
            bench.plan(f.judge, STARTED + f.application, f.environment, slug=slug, timeout_s=30.0)
            for slug, f in faults.items()
        ]
        found = {outcome.slug: outcome for outcome in bench.run(*plans, parallel=len(plans))}
        nothing_left(bench)
        return found

    return on


def nothing_left(bench: Bench) -> None:
    """No process of these scripts, no lease and no shared memory that they made."""
    logs = "".join(p.read_text()[:1000] for p in bench.folder.glob("report/*/logs/application.app.log"))
    memories = re.findall(r"^memory (\S+)$", logs, re.MULTILINE)
    assert [name for name in memories if Path("/tmp", name).exists()] == []
    assert list((bench.folder / "leases").glob("*.json")) == []
    assert gone(f"{bench.folder}/", 5.0)


@pytest.mark.parametrize(("backend", "faults"), by_backend())  # with MARKS, such as mark.engine
def test_faults_at_once(backend: str, faults: dict[str, Fault], run: Run, bench: Bench, book: Book) -> None:
    as_told(faults, run(backend, faults), backend, book)

    def log(slug: str) -> str:
        return next(bench.folder.glob(f"report/*{slug}/logs/application.app.log")).read_text()

    assert re.search(r"^memory \S*video0.argb$", log("neighbour"), re.MULTILINE)
    whole_logs(faults, log)


@pytest.mark.slow
def test_service_that_never_gets_ready(run: Run, book: Book, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(engine, "READY_PATIENCE_S", 2.0)
    faults = {"never-ready": NEVER_READY}
    as_told(faults, run("process", faults), "process", book)
