"""``dodo compile --jobs``."""

import json
import sys
from pathlib import Path

import pytest
import yaml

from dodo_dsl.cli.main import main

ROOT = Path(__file__).parents[3]
STRAIGHT = "sil-closed-straight"


def results(folder: Path, **took: float) -> Path:
    tests = [
        {
            "name": slug, "slug": slug, "spec": "a.dodo.yml", "level": "sil", "kind": "closed-loop",
            "outcome": "passed", "reason": "", "setup_s": 1.0, "execution_s": seconds - 1.0, "sim_s": None, "cid": 130,
            "seed": 1, "clock": "lockstep", "backend": "process", "services": [], "checks": [],
        }
        for slug, seconds in took.items()
    ]  # fmt: skip
    folder.mkdir()
    (folder / "results.json").write_text(json.dumps({"dodo": "results", "version": 1, "tests": tests}))
    return folder


@pytest.mark.thorough
def test_tests_share_jobs_by_their_times(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(ROOT)
    one = results(tmp_path / "one", **{STRAIGHT: 9.0, "sil-open-straight": 60.0})
    two = results(tmp_path / "two", **{STRAIGHT: 99.0, "sil-open-left-curve": 30.0})
    command = ["compile", STRAIGHT, "sil-open-straight", "sil-open-left-curve", "-o", str(tmp_path / "out")]
    packed = [*command, "--jobs", "2"]
    times = ["--times", str(one), "--times", str(two / "results.json")]
    assert main([*packed, *times], sys.stdout, sys.stderr) == 0
    assert capsys.readouterr().out.splitlines()[-1] == "packed into 2 jobs, about 1 min 39 s in 'sil-closed-straight'"
    made = yaml.safe_load((tmp_path / "out/child.gitlab-ci.yml").read_text())
    assert "sil-open-left-curve --compiled" in made["tests 2/2"]["script"][0]
    assert main([*packed, *times, "--check"], sys.stdout, sys.stderr) == 0, "nothing is stale"
    capsys.readouterr()
    assert main(packed, sys.stdout, sys.stderr) == 0
    said = capsys.readouterr().out.splitlines()[-2:]
    assert said[0].startswith("packed into 2 jobs, at most ") and "and 2 more" in said[1]
    assert main([*command, *times], sys.stdout, sys.stderr) == 2
    assert main([*packed, "--times", str(tmp_path / "gone.json")], sys.stdout, sys.stderr) == 2
