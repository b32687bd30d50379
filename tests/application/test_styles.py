"""Compose files of many styles, rewritten as the goldens have it and accepted by compose as part of a test."""

import re
import shutil
import subprocess
from pathlib import Path

import pytest

from dodo_dsl import diagnostics
from dodo_dsl.application.access.model import Access
from dodo_dsl.application.model import plain
from dodo_dsl.application.read import read_application
from dodo_dsl.diagnostics import format_text
from dodo_dsl.emit.render import render_plan
from dodo_dsl.plan.model import Plan, PlannedService
from dodo_dsl.plan.plan_json import from_json, to_json
from dodo_dsl.plan.rewrite.rewrite import plan_application
from dodo_dsl.plan.rewrite.service_copy import Setting
from tests.emit.readers import compose

FOLDER = Path(__file__).parent
STYLES = sorted(p.name for p in (FOLDER / "good").iterdir())
PATHS = ("/opt/models", *(str(Path.home() / name) for name in ("kiwi-recordings", "models", "recordings")))
"""What 'paths' in dodo.yml names: styles mount these folders of the host."""
WAYS = ("network", "host", "hil")


def files(folder: Path) -> list[Path]:
    """The files that ``docker compose -f`` would be given."""
    return sorted(p for p in folder.iterdir() if p.suffix in (".yml", ".yaml"))[::-1]


def plan(folder: Path, way: str, out: Path) -> tuple[Plan, str]:
    """The Plan of a test with the application in a folder, and the text about its problems."""
    source, problems = read_application(files(folder), Access(paths=PATHS))
    assert source is not None, format_text(problems)
    hil = way == "hil"
    isolation = "network" if way == "network" else "host"
    setting = Setting(140, isolation, out, ("judge-of-test",), hil=hil, privileged_allowed=hil)
    application = plan_application(source, setting)
    judge = PlannedService("evaluation", "judge-of-test", "collision", "dodo/collision:1", (), (), True)
    subnet = "10.213.0.0/28" if way == "network" else ""
    common = (
        "",
        "hil" if hil else "sil",
        "closed-loop",
        10.0,
        "realtime",
        isolation,
        1,
        140,
        subnet,
        "sil",
        "dodo/sandbox:1",
    )
    return Plan("t", "t", "t.dodo.yml", *common, (judge,), application), format_text(problems)


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("style", STYLES)
def test_goldens(style: str, way: str, monkeypatch: pytest.MonkeyPatch, update_goldens: bool) -> None:
    monkeypatch.chdir(FOLDER / "good" / style)
    diagnostics._lines.cache_clear()  # every style has files of the same names
    made, said = plan(Path(), way, Path("../../generated/t").resolve())
    texts = {file.path: file.text for file in render_plan(made)}
    variables = "".join(f"# .env: {line}\n" for line in texts["t/.env"].splitlines()[3:])
    text = texts["t/application.compose.yml"] + variables + "".join(f"# {line}\n" for line in said.splitlines())
    golden = FOLDER / "golden" / f"{style}.{way}.yml"
    if update_goldens:
        golden.write_text(text)
    assert text == golden.read_text()


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("style", STYLES)
def test_the_first_lines_name_each_key_that_differs(style: str, way: str, tmp_path: Path) -> None:
    source, _ = read_application(files(FOLDER / "good" / style), Access(paths=PATHS))
    made, _ = plan(FOLDER / "good" / style, way, tmp_path)
    assert source is not None and made.application is not None
    copied = made.application.compose
    for name, service in source.services.items():
        written, ours = plain(service.node), copied["services"][name]
        said = [line for line in made.application.changes if line.startswith((f"{name}: ", "all services: "))]
        differ = [key for key in {**written, **ours} if written.get(key) != ours.get(key)]
        assert [key for key in differ if not re.search(rf"[ :]{key}\b", " ".join(said))] == []
    beside = {key: plain(node) for key, node in source.rest.items()}
    said = [line for line in made.application.changes if ": " in line]
    assert [key for key in beside if copied[key] != beside[key] and key.removesuffix("s") not in " ".join(said)] == []


@pytest.mark.slow
@pytest.mark.parametrize("style", STYLES)
def test_compose_accepts_them(style: str, tmp_path: Path) -> None:
    command = compose()
    shutil.copytree(FOLDER / "good", tmp_path / "team")
    (tmp_path / "team" / ".git").mkdir()
    for way in ("network", "hil"):  # hil has what host has, and hardware
        made, _ = plan(tmp_path / "team" / style, way, tmp_path / "generated" / way / "t")
        for file in render_plan(made):
            path = tmp_path / "generated" / way / file.path
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(file.text)
        folder = tmp_path / "generated" / way / "t"
        result = subprocess.run([*command, "config", "-q"], cwd=folder, capture_output=True, text=True, check=False)
        unset = [line for line in result.stderr.splitlines() if "variable is not set" not in line]
        assert (result.returncode, unset) == (0, []), way


@pytest.mark.parametrize("style", STYLES)
def test_plans_survive_their_file(style: str, tmp_path: Path) -> None:
    made, _ = plan(FOLDER / "good" / style, "network", tmp_path)
    text = to_json(made)
    assert to_json(from_json(text)) == text
    assert from_json(text).application == made.application


def test_every_golden_has_its_style() -> None:
    names = {f"{style}.{way}.yml" for style in STYLES for way in WAYS}
    assert {p.name for p in (FOLDER / "golden").iterdir()} == names
