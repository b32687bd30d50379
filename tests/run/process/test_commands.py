"""What the process backend makes of services: their words, their variables, and where they come from."""

from pathlib import Path

import pytest

from dodo_dsl.run.process.commands import Commands
from dodo_dsl.run.process.confinement import Command
from dodo_dsl.run.process.slot import Slot
from tests.application.compiled import FILE, compiled, repository

COMPOSE = """\
services:
  planner:
    image: team/planner
    command: run --cid=${CID} --rate=${RATE} --greeting=${GREETING} ${NOTHING} session=${CID}
    env_file: [car.env, {path: private.env, required: false}, {path: raw.env, format: raw}, last.env]
    environment:
      LEVEL: debug
      FROM_OUTSIDE:
      NOWHERE:
      LEAK: ${CI_JOB_TOKEN}
      CI_JOB_TOKEN:
      LICENSE: ${LICENSE_KEY:-none}
      FLAGS: --cid=111 --rate=${RATE:-${NOTHING:-3}}
    x-dodo-process: [python, planner.py]
"""


def command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, *passed: str) -> Command:
    """The command of the compose file above."""
    for name in ("FROM_OUTSIDE", "CI_JOB_TOKEN", "LICENSE_KEY", "UNNAMED"):
        monkeypatch.setenv(name, "here")
    files = {
        FILE: COMPOSE,
        "planner.py": "",
        ".env": "CID=111\nRATE=20\nGREETING='costs $5'\n",
        "car.env": "WHEELBASE=0.257\nLEVEL=info\nOD4SESSION_CID=111\nTWICE=${RATE}${RATE}\n",
        "raw.env": 'RAW="$RATE" # all\nLEVEL=raw\n',
        "last.env": "SAID=${LEVEL} ${WHEELBASE} ${RAW}\nNOTE=   # of the service, and earlier files\n",
    }
    test = compiled(repository(tmp_path, files), way="host", environment=list(passed))
    assert test.plan is not None, test.told
    commands = Commands(test.plan, test.folder, tmp_path / "report", Slot(150))
    (made,) = [commands.of(service) for service in test.plan.application.services]
    return made


def test_words_and_variables(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made = command(tmp_path, monkeypatch)
    assert made.argv == (
        *("python", "planner.py", "run", "--cid=150", "--rate=20", "--greeting=costs", "$5"),
        "session=150",
    )
    expected = {
        "LEVEL": "debug",
        "FLAGS": "--cid=150 --rate=20",
        "WHEELBASE": "0.257",
        "OD4SESSION_CID": "150",
        "TWICE": "2020",
        "RAW": '"$RATE" # all',
        "SAID": 'debug 0.257 "$RATE" # all',
        "NOTE": "# of the service, and earlier files",
        "LEAK": "",
        "LICENSE": "none",
    }
    assert {name: made.environment.get(name) for name in expected} == expected
    assert "FROM_OUTSIDE" not in made.environment
    assert command(tmp_path, monkeypatch, "FROM_OUTSIDE").environment["FROM_OUTSIDE"] == "here"
    assert not {"NOWHERE", "CI_JOB_TOKEN", "UNNAMED"} & set(made.environment)
    assert made.folder == str(tmp_path / "team")


def test_variables_that_the_deployment_passes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made = command(tmp_path, monkeypatch, "LICENSE_KEY", "UNNAMED")
    assert [made.environment[name] for name in ("LICENSE", "LICENSE_KEY", "UNNAMED", "LEAK")] == ["here"] * 3 + [""]


@pytest.mark.parametrize(
    ("old", "new", "argv", "platform"),
    [
        ("LEVEL: debug", "LEVEL: debug", ("python", "planner.py"), "offscreen"),
        ("LEVEL: debug", "QT_QPA_PLATFORM: vnc", ("python", "planner.py"), "vnc"),
        ("LEVEL: debug", "DISPLAY: ':7'", ("python", "planner.py"), None),
        ("    x-dodo-process", "    x-dodo: {display: true}\n    x-dodo-process", ("xvfb-run", "-a"), None),
    ],
)
def test_where_a_program_draws(
    old: str, new: str, argv: tuple[str, ...], platform: str | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("QT_QPA_PLATFORM", raising=False)
    monkeypatch.setitem(globals(), "COMPOSE", COMPOSE.replace(old, new))
    made = command(tmp_path, monkeypatch)
    assert (made.argv[:2], made.environment.get("QT_QPA_PLATFORM")) == (argv, platform)
    assert "planner.py" in made.argv
