"""``dodo compile --search``: which tests a pipeline can search."""

from pathlib import Path

import pytest
import yaml

from tests.check import examples
from tests.emit.readers import run
from tests.search.scripted_drives import SPEC


@pytest.fixture(autouse=True)
def repository(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    examples.write(SPEC, tmp_path)


def jobs() -> dict[str, dict[str, object]]:
    return dict(yaml.safe_load(Path("generated/child.gitlab-ci.yml").read_text()))


@pytest.mark.thorough
def test_jobs_of_the_search_are_added() -> None:
    search = (
        "--search",
        "example",
        "--search",
        "tests/example/example.dodo.yml",
        "--application",
        "docker-compose.yml",
    )
    assert run("compile", "base", *search)[0] == 0
    made = jobs()
    assert {"base", "search example", "search example report"} <= made.keys() and "example" not in made
    assert made["search example"]["parallel"] == 4
    assert "dodo search example --application docker-compose.yml --storage" in str(made["search example"]["script"])
    assert run("compile", "base", *search, "--check")[0] == 0
    code, out, _ = run("compile", "base", *search, "--workers", "9", "--check")
    assert code == 1 and "+  parallel: 9\n" in out


def test_a_pipeline_without_searches_has_none() -> None:
    assert run("compile")[0] == 0
    assert not any(name.startswith("search") for name in jobs())


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--search", "base"), "base has no ranges to search"),
        (("--search", "nothing"), "unknown test 'nothing'"),
        (("--search", "example", "--workers", "201"), "--workers 201 is more than the 200 jobs"),
        (("--workers", "2"), "--workers are jobs of a search: name its test with --search"),
    ],
)
def test_what_cannot_be_searched(words: tuple[str, ...], said: str) -> None:
    code, _, err = run("compile", *words)
    assert code == 2 and said in err
    assert not Path("generated").exists()


def test_problems_of_the_searched_test_are_said() -> None:
    path = Path(examples.EXAMPLE)
    path.write_text(path.read_text().replace("from: -8 cm", "from: -8 ms"))
    code, _, err = run("compile", "base", "--search", "example")
    assert code == 2 and "'example' cannot be searched:" in err and "-8 ms" in err
