"""``dodo compile --check --fix``: what it writes compiles, and what it leaves alone stays as it was."""

import difflib
import io
import shutil
from pathlib import Path

import pytest

from dodo_dsl.cli.main import main
from dodo_dsl.package_data import registry

SPEC = """\
dodo: 1
name: drive
description: Drive to the finish line.   # comments stay
level: sil
kind: closed-loop
timeout: 60 s
clock: lockstep
environment:
  camera: {uses: virtual-camera, with: {map-path: ../maps/straight, freq: 10 Hz}}  # and layout
action:
  vehicle: {uses: dynamic-model}
  pose:    {uses: integrator, with: {yaw: 84 deg}}
evaluation:
  track: {uses: collision, with: {goal: finish, max-time: 40 s}}
"""
FIXED = {
    "turned service": ("virtual-camera", "camera-virtual"),
    "turned parameter": ("max-time", "time-max"),
    "misspelt service": ("dynamic-model", "dynamic-modle"),
    "misspelt key": ("description", "descripton"),
    "misspelt unit": ("84 deg", "84 dgr"),
    "missing space": ("freq: 10 Hz", "freq:10 Hz"),
    "missing space of a key on a line": ("level: sil", "level:sil"),
    "missing spaces of two such keys": ("name: drive\ndescription: Drive", "name:drive\ndescription:Drive"),
    "obstacle of the map": ("goal: finish", "goal: finsh"),
    "kind": ("closed-loop", "closed_loop"),
    "clock": ("lockstep", "lockstpe"),
}
COMPOSE = """\
services:
  perception: {image: team/perception, command: --cid=111, volumes: ["models:/models:ro"]}   # sees
  steering:
    image: team/steering
    command: --cid=111
    depends_on: [perception]
    x-dodo: {out: [opendlv.proxy.GroundSteeringRequest, opendlv.proxy.PedalPositionRequest]}
volumes: {models: }
"""
FIXED_APPLICATION = {
    "service": ("depends_on: [perception]", "depends_on: [perceptoin]"),
    "service as a key": ("depends_on: [perception]", "depends_on: {perceptoin: {condition: service_started}}"),
    "service and its alias": ("depends_on: [perception]", 'links: ["perceptoin:eyes"]'),
    "namespace": ("depends_on: [perception]", "ipc: service:perceptoin"),
    "key": ("depends_on: [perception]", "depend_on: [perception]"),
    "key of DoDo": ("x-dodo: {out:", "x-dodo: {outt:"),
    "volume": ('"models:/models:ro"', '"modles:/modles:ro"'),
    "volume in the long form": (
        '["models:/models:ro"]',
        "[{type: volume, source: modles, target: /m}]",
    ),
}
LEFT_APPLICATION = {
    "the service itself": ("depends_on: [perception]", "depends_on: [steerin]"),
    "a service that is there already": ("depends_on: [perception]", "depends_on: [perception, perceptoin]"),
    "a key that is there already": ("image: team/steering", "image: team/steering\n    imagee: team/steering"),
}
LEFT = {
    "a unit that may be one of several": ("freq: 10 Hz", "freq: 10"),
    "a line that may go on with the text above": ("# comments stay\n", "\nNote:without leaving it.\n"),
    "a word like no other": ("dynamic-model", "spaceship"),
    "a key that is there already": ("max-time: 40 s", "max-time: 40 s, max-tim: 3 s"),
}


@pytest.fixture
def spec(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    shutil.copytree(registry() / "maps/straight", tmp_path / "tests/maps/straight")
    (tmp_path / "dodo.yml").write_text("dodo: 1\nregistry: [tests]\n")
    (tmp_path / "tests/drive").mkdir()
    monkeypatch.chdir(tmp_path)
    return tmp_path / "tests/drive/drive.dodo.yml"


def check(*words: str) -> tuple[int, str]:
    out = io.StringIO()
    return main(["compile", "--check", *words], out, out), out.getvalue()


def wrong(changes: tuple[str, str]) -> str:
    right, instead = changes
    assert SPEC.count(right) == 1
    return SPEC.replace(right, instead)


@pytest.mark.parametrize("case", FIXED)
def test_the_only_fix_is_written_and_compiles(case: str, spec: Path) -> None:
    spec.write_text(wrong(FIXED[case]))
    assert check()[0] == 2
    code, said = check("--fix")
    assert (code, spec.read_text()) == (0, SPEC)
    diff = difflib.ndiff(wrong(FIXED[case]).splitlines(), SPEC.splitlines())
    assert {line[0] + line[2:] for line in diff if line[0] in "-+"} <= {*said.splitlines()}


def test_line_ends_stay_and_all_is_fixed_at_once(spec: Path) -> None:
    text = SPEC
    for case in ("turned service", "turned parameter", "misspelt unit"):
        text = text.replace(*FIXED[case])
    spec.write_bytes(text.replace("\n", "\r\n").encode())
    assert check("--fix")[0] == 0
    assert spec.read_bytes() == SPEC.replace("\n", "\r\n").encode()


def compose(spec: Path, text: str) -> Path:
    """The compose file of an application, which the deployment of the test names."""
    spec.write_text(SPEC)
    file = spec.parents[2] / "docker-compose.yml"
    file.write_text(text)
    (spec.parents[2] / "dodo.yml").write_text("dodo: 1\nregistry: [tests]\napplication: docker-compose.yml\n")
    return file


@pytest.mark.parametrize("case", FIXED_APPLICATION)
def test_the_only_fix_of_a_compose_file_is_written(case: str, spec: Path) -> None:
    right, wrong = FIXED_APPLICATION[case]
    file = compose(spec, COMPOSE.replace(right, wrong))
    assert check()[0] == 2
    assert check("--fix")[0] == 0
    expected = (
        wrong.replace("perceptoin", "perception").replace("modles:/m", "models:/m").replace(": modles", ": models")
    )
    expected = expected.replace("depend_on", "depends_on").replace("outt", "out")
    assert file.read_text() == COMPOSE.replace(right, expected)


@pytest.mark.parametrize("case", LEFT_APPLICATION)
def test_what_has_no_single_fix_in_a_compose_file_stays(case: str, spec: Path) -> None:
    text = COMPOSE.replace(*LEFT_APPLICATION[case])
    file = compose(spec, text)
    assert check("--fix") == check()
    assert check()[0] == 2
    assert file.read_text() == text


@pytest.mark.parametrize("case", LEFT)
def test_what_has_no_single_fix_stays(case: str, spec: Path) -> None:
    spec.write_text(wrong(LEFT[case]))
    assert check("--fix") == check()
    assert spec.read_text() == wrong(LEFT[case])


def test_files_outside_the_repository_stay(spec: Path, tmp_path_factory: pytest.TempPathFactory) -> None:
    other = tmp_path_factory.mktemp("other") / "drive.dodo.yml"
    other.write_text(wrong(FIXED["turned service"]))
    code, said = check("--fix", str(other))
    assert code == 2
    assert "unknown service 'camera-virtual'" in said
    assert other.read_text() == wrong(FIXED["turned service"])


def test_it_needs_check(spec: Path) -> None:
    out = io.StringIO()
    assert main(["compile", "--fix"], out, out) == 2
    assert out.getvalue() == "dodo compile: --fix applies to --check\n"
