"""Projects that are checked again and again, against ones that are checked for the first time."""

from pathlib import Path

import pytest

from dodo_dsl.diagnostics import Diagnostic
from dodo_dsl.lsp.project import Projects, Texts
from tests.lsp.conftest import COMPOSE, DEPLOYMENT, LONGER, SPEC, Repository

SPECS = (
    SPEC,
    SPEC.replace("10 Hz", "10"),
    SPEC.replace("name: sil-my-straight", "name: sil-longer"),
    SPEC.replace("  pose:", "  place:"),
    SPEC.replace("[left, right]", "[left"),
    SPEC.replace("environment:", "matrix: {max: [1 s, 70 s]}\nenvironment:").replace("40 s", "${matrix.max}"),
    SPEC.replace("environment:", "vary: {max: {from: 9 s, to: 70 s, nominal: 20 s}}\nenvironment:").replace(
        "40 s", "${vary.max}"
    ),
)
LONGERS = (LONGER, LONGER.replace("sil-longer", "sil-my-straight"), LONGER.replace("max-time", "max-tiem"), "")
DEPLOYMENTS = (DEPLOYMENT, DEPLOYMENT.replace("registry", "registri"), "dodo: 1\nregistry: [tests]\ncids: 128-128\n")


def found(projects: Projects, shown: dict[Path, str]) -> list[tuple[Diagnostic, ...]]:
    return [project.diagnostics for project in projects.check(shown)]


@pytest.mark.thorough
def test_what_is_not_checked_again_has_not_changed(repository: Repository) -> None:
    """Each state follows another one, from which everything that is still the same may be taken."""
    states = [(spec, LONGER, DEPLOYMENT) for spec in SPECS]
    states += [(SPEC, longer, DEPLOYMENT) for longer in LONGERS]
    states += [(SPECS[2], LONGERS[1], DEPLOYMENT), *((SPEC, LONGER, deployment) for deployment in DEPLOYMENTS)]
    texts = Texts()
    again = Projects(texts)
    for state in states:
        shown = dict(zip((repository.spec, repository.longer, repository.deployment), state, strict=True))
        assert found(again, shown) == found(Projects(texts), shown), state


def test_the_application_counts_as_it_is_shown(repository: Repository) -> None:
    compose = repository.folder / "docker-compose.yml"
    projects = Projects()
    (broken,) = projects.check({repository.spec: SPEC, compose: COMPOSE.replace("services:", "service:")})
    assert {Path(d.span.file) for d in broken.diagnostics} == {compose}
    (taken,) = projects.check({repository.spec: SPEC, compose: COMPOSE.replace("steering:", "camera:")})
    assert {d.rule for d in taken.diagnostics} == {"service-taken"}
    (fine,) = projects.check({repository.spec: SPEC, compose: COMPOSE})
    assert fine.ok


def test_a_change_checks_again_only_what_it_can_affect(repository: Repository) -> None:
    projects = Projects()
    (first,) = projects.check({repository.spec: SPEC})
    (second,) = projects.check({repository.spec: SPEC, repository.longer: LONGER.replace("50 s", "55 s")})
    before, after = ({t.spec.path: t for t in p.tests} for p in (first, second))
    assert after[repository.spec] is before[repository.spec]
    assert after[repository.longer] is not before[repository.longer]
    projects.forget()
    (third,) = projects.check({repository.spec: SPEC})
    assert all(test is not after[test.spec.path] for test in third.tests)
