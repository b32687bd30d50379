"""Which tests words mean, and what is said about those that ship with DoDo."""

from pathlib import Path

import pytest

from dodo_dsl.cli.errors import UsageError
from dodo_dsl.cli.selection import NoSuchTest, select

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
        ("sil-closed-straight", "'sil-closed-straight'"),
        ("sil-perception[light=1,clutter=0]", "'sil-perception'"),
        ("sil-perception--light-1--clutter-0", "'sil-perception'"),
        ("hil-*", "'hil-camera'"),
    ],
)
def test_a_shipped_test_that_the_deployment_leaves_out(repository: Path, word: str, said: str) -> None:
    deployment(repository, "tests")
    with pytest.raises(NoSuchTest) as problem:
        select([word], (), ())
    assert (
        str(problem.value) == f"unknown test '{word}'; {said} ships with DoDo: add \"dodo:\" to 'registry' in dodo.yml"
    )


@pytest.mark.thorough
def test_problems_of_the_deployment_come_before_names_that_it_may_have(repository: Path) -> None:
    deployment(repository, "tests, dodo:")
    with pytest.raises(UsageError, match=r"yaml-syntax(?s:.*)hint: look at brackets, quotes"):
        select(["my-test"], (), ())


@pytest.mark.thorough
def test_who_has_the_shipped_tests_is_not_told_to_add_them(repository: Path) -> None:
    deployment(repository, 'tests, "dodo:"')
    with pytest.raises(NoSuchTest, match=r"^unknown test 'sil-percept'; did you mean 'sil-perception'"):
        select(["sil-percept"], (), ())


@pytest.mark.thorough
def test_warnings_about_shipped_tests_are_not_for_who_did_not_write_them(repository: Path) -> None:
    deployment(repository, '"dodo:"')
    assert not select(["sil-perception"], (), ()).diagnostics


CLUTTER = "sil-perception[light={},clutter={}]".format


@pytest.mark.parametrize(
    ("word", "titles"),
    [
        ("sil-perception[light=1]", [CLUTTER(1, 0), CLUTTER(1, 60)]),
        ("sil-perception[clutter=0, light=1]", [CLUTTER(1, 0)]),
        ("sil-perception[light=1,light=1.8,clutter=0]", [CLUTTER(1, 0), CLUTTER(1.8, 0)]),
        ("sil-perc*[light=1*,clutter=0]", [CLUTTER(1, 0), CLUTTER(1.8, 0)]),
        ("sil-perception[light=1,*]", [CLUTTER(1, 0), CLUTTER(1, 60)]),
        ("sil-perception--light-1--clutter-0", [CLUTTER(1, 0)]),
    ],
)
def test_parameters_select_the_instances_that_have_them(repository: Path, word: str, titles: list[str]) -> None:
    deployment(repository, '"dodo:"')
    assert [spec.title for spec in select([word], (), ()).specs] == titles


@pytest.mark.parametrize("pair", ["lihgt=1", "light=2", "light=1,light=2,clutter=3"])
def test_values_that_no_instance_has_are_told_with_what_there_is(repository: Path, pair: str) -> None:
    deployment(repository, '"dodo:"')
    with pytest.raises(NoSuchTest, match=r"no instance of .* has these values; known: sil-perception.light"):
        select([f"sil-perception[{pair}]"], (), ())
    with pytest.raises(NoSuchTest, match=r"^unknown test 'sil-percept\[light=1\]'; did you mean 'sil-perception'"):
        select(["sil-percept[light=1]"], (), ())


def test_a_value_may_be_a_path(repository: Path) -> None:
    (repository / "tests/look").mkdir()
    (repository / "tests/look/look.dodo.yml").write_text("dodo: 1\nname: look\nmatrix: {map: [maps/a, maps/b]}\n")
    (repository / "dodo.yml").write_text("dodo: 1\nregistry: [tests]\n")
    assert [spec.title for spec in select(["look[map=maps/b]"], (), ()).specs] == ["look[map=maps/b]"]
