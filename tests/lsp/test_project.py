"""Projects as the editor shows them."""

from pathlib import Path

from dodo_dsl.lsp.project import Projects
from tests.lsp.conftest import COMPOSE, SPEC, Repository


def test_the_application_counts_as_it_is_shown(repository: Repository) -> None:
    compose = repository.folder / "docker-compose.yml"
    projects = Projects()
    (broken,) = projects.check({repository.spec: SPEC, compose: COMPOSE.replace("services:", "service:")})
    assert {Path(d.span.file) for d in broken.diagnostics} == {compose}
    (taken,) = projects.check({repository.spec: SPEC, compose: COMPOSE.replace("steering:", "camera:")})
    assert {d.rule for d in taken.diagnostics} == {"service-taken"}
    (fine,) = projects.check({repository.spec: SPEC, compose: COMPOSE})
    assert fine.ok
