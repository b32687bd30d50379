"""Values in a compose file are refused where compose refuses them, and nowhere else."""

import subprocess
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from tests.application.compiled import compiled, repository
from tests.application.compose_values import NO_VOLUMES, RIGHT, WRONG, compose_file
from tests.emit.readers import compose


@pytest.mark.parametrize(
    ("value", "is_right"),
    [(v, True) for v in RIGHT] + [(v, False) for v in (*WRONG, *NO_VOLUMES)],
)
def test_dodo_judges(value: str, is_right: bool, tmp_path: Path) -> None:
    test = compiled(repository(tmp_path, {"data/x": ""}), compose_file(value))
    assert bool(test.errors) != is_right, test.told


@pytest.mark.slow
@pytest.mark.parametrize("step", [5, pytest.param(1, marks=pytest.mark.proof)], ids=["few", "all"])
def test_compose_judges_alike(step: int, tmp_path: Path) -> None:
    """Of every so many values, as each takes a process."""
    right, wrong = RIGHT[::step], WRONG[::step]
    command = [*compose(), "-f", "-", "config", "-q"]

    def is_right(value: str) -> bool:
        text = compose_file(value)
        return not subprocess.run(
            command, input=text.encode(), cwd=tmp_path, capture_output=True, check=False
        ).returncode

    with ThreadPoolExecutor(2) as pool:
        judged = dict(zip([*right, *wrong], pool.map(is_right, [*right, *wrong]), strict=True))
    assert judged == dict.fromkeys(right, True) | dict.fromkeys(wrong, False)
