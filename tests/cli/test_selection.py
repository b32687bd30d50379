"""Which tests words mean, and what is said about those that ship with DoDo."""

from pathlib import Path

import pytest

from dodo_dsl.cli.selection import NoSuchTest, select
from dodo_dsl.compiler import load

DETECTIONS = [f"opendlv.logic.perception.Detection{part}" for part in ("Type", "Property", "BoundingBox")]


@pytest.fixture
def repository(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "tests").mkdir()
    return tmp_path


def deployment(repository: Path, registry: str) -> None:
    (repository / "dodo.yml").write_text(f"dodo: 1\nregistry: [{registry}]\napplication: compose.yml\n")
    service = f"image: example, command: --cid=111, x-dodo: {{in: [], out: [{', '.join(DETECTIONS)}]}}"
    (repository / "compose.yml").write_text(f"services: {{app: {{{service}}}}}\n")


@pytest.mark.parametrize(
    ("word", "said"),
    [
        ("sil-closed-straight", "it ships with DoDo"),
        ("sil-perception[light=1,clutter=0]", "'sil-perception' ships with DoDo"),
        ("sil-perception--light-1--clutter-0", "'sil-perception' ships with DoDo"),
        ("hil-*", "'hil-camera' and 3 more ship with DoDo"),
    ],
)
def test_a_shipped_test_that_the_deployment_leaves_out(repository: Path, word: str, said: str) -> None:
    deployment(repository, "tests")
    with pytest.raises(NoSuchTest) as problem:
        select([word], (), ())
    assert str(problem.value) == f"there is no test '{word}'; {said}: add \"dodo:\" to 'registry' in dodo.yml"


def test_who_has_the_shipped_tests_is_not_told_to_add_them(repository: Path) -> None:
    deployment(repository, 'tests, "dodo:"')
    with pytest.raises(NoSuchTest, match=r"^there is no test 'sil-percept'; did you mean 'sil-perception'"):
        select(["sil-percept"], (), ())


def test_warnings_about_shipped_tests_are_not_for_who_did_not_write_them(repository: Path) -> None:
    deployment(repository, '"dodo:"')
    assert {d.rule for d in load([]).diagnostics if d.severity == "warning"} == {"clock-answers"}
    assert not select(["sil-perception"], (), ()).diagnostics
