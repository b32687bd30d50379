"""``dodo new``: what it writes compiles at once, and nothing that is there changes."""

import os
import re
import shutil
import subprocess
import sys
from io import StringIO
from pathlib import Path
from typing import Any

import pytest
import yaml

from dodo_dsl import package_data
from dodo_dsl.cli.main import main
from dodo_dsl.cli.new import STARTS
from dodo_dsl.compiler import NoApplication, load
from dodo_dsl.opendlv import odvd
from dodo_dsl.opendlv.odvd import STANDARD
from tests.test_documentation import PROGRAM, README, block


def dodo(*words: str) -> tuple[int, str, str]:
    stdout, stderr = StringIO(), StringIO()
    code = main(words, stdout, stderr)
    return code, stdout.getvalue(), stderr.getvalue()


@pytest.fixture
def empty(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


COMPOSE = "services: {app: {image: example, command: --cid=111}}\n"
FINE = (0, "1 test checked: no problems\n", "")


@pytest.fixture
def repository(empty: Path) -> Path:
    (empty / "compose.yaml").write_text(COMPOSE)
    (empty / "dodo.yml").write_text("dodo: 1\nregistry: [tests]\napplication: compose.yaml\n")
    return empty


def contents(folder: Path) -> dict[str, bytes]:
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def written(out: str) -> set[str]:
    return {line.removeprefix("wrote ") for line in out.splitlines() if line.startswith("wrote ")}


@pytest.mark.parametrize(("level", "kind"), STARTS)
@pytest.mark.thorough
def test_a_new_test_compiles_at_once(repository: Path, level: str, kind: str) -> None:
    code, out, err = dodo("new", "my-test", "--level", level, "--kind", kind)
    assert (code, err) == (0, "")
    assert "tests/my-test/my-test.dodo.yml" in written(out)
    code, out, err = dodo("compile", "--check")
    assert (code, err, out.partition(" checked: ")[2]) == (0, "", "no problems\n")
    spec = yaml.safe_load((repository / "tests/my-test/my-test.dodo.yml").read_text())
    assert (spec["level"], spec["kind"]) == (level, kind)
    assert dodo("compile")[0] == 0


def test_the_file_is_that_of_the_readme(repository: Path) -> None:
    assert dodo("new", "sil-my-straight")[0] == 0
    assert (repository / "tests/sil-my-straight/sil-my-straight.dodo.yml").read_text() == block("evaluation:", README)


@pytest.mark.thorough
def test_a_new_test_may_extend_another(repository: Path) -> None:
    assert dodo("new", "first")[0] == dodo("new", "second", "--extends", "first")[0] == 0
    assert dodo("compile", "--check") == (0, "2 tests checked: no problems\n", "")
    spec = yaml.safe_load((repository / "tests/second/second.dodo.yml").read_text())
    assert spec["extends"] == "../first/first.dodo.yml"


@pytest.mark.thorough
def test_editors_find_the_schema_that_was_asked_for(repository: Path) -> None:
    assert dodo("new", "--schemas")[0] == dodo("new", "first")[0] == 0
    line = (repository / "tests/first/first.dodo.yml").read_text().splitlines()[0]
    schema = repository / "tests/first" / line.partition("$schema=")[2]
    assert '"title": "DoDo test"' in schema.read_text()
    assert dodo("new", "--schemas")[0] == 2


REFUSED: list[tuple[list[str], str]] = [
    (["First"], "'First' is not a valid name, expected lower-case letters and digits in words joined by"),
    (["../first"], "'../first' is not a valid name"),
    (["a" * 61], "at most 60 characters"),
    (["variables"], "'variables' is a keyword of GitLab's pipelines"),
    (["there"], "there is a test 'there' already; names are unique over all registries"),
    (["new", "--extends", "their"], "unknown test 'their' to extend; did you mean 'there'?"),
    (["new", "--extends", "there", "--level", "hil"], "--level, --kind and --rec do not apply with --extends"),
    (["new", "--level", "dil"], "; try: dodo new new --level dil --kind open-loop"),
    (["new", "--language", "cpp"], "--language applies to --application"),
    (["--deployment", "--level", "hil"], "--level applies to a test"),
    (["--application", "--ros", "--language", "cpp"], "the node of --ros is written in Python"),
    (["--application"], "'dodo.yml' exists already; nothing was written"),
    ([], "name the new test: dodo new NAME"),
    (["--map", "track"], "--map needs --line, the centre line of the track: expected parts such as 'straight 2 m"),
    (["--map", "track", "--line", "straight 2"], "--line: '2' has no unit, expected a length in m"),
    (["--map", "track", "--line", "ahead 2 m"], "--line: 'ahead 2 m' is not part of a centre line, expected"),
    (["--map", "track", "--line", "straight 2000 m"], "is out of range, expected more than 0 and less than 1000 m"),
    (["--map", "track", "--line", "left 90 deg radius 20 cm"], "radius 0.2 m is too tight for a track of 0.5 m"),
    (["--map", "track", "--lap", "--line", "straight 2 m"], "the lap does not close: it ends 2.000 m and 0.0 deg from"),
]


@pytest.mark.thorough
def test_what_cannot_be_begun_is_said_and_writes_nothing(repository: Path) -> None:
    assert dodo("new", "there")[0] == 0
    (repository / "compose.yaml").rename(repository / "other.yaml")
    before = contents(repository)
    for words, said in REFUSED:
        code, out, err = dodo("new", *words)
        assert (code, out) == (2, ""), words
        assert said in err
        assert contents(repository) == before


@pytest.mark.thorough
def test_an_empty_folder_becomes_a_repository(empty: Path) -> None:
    code, out, err = dodo("new", "first")
    assert (code, err) == (0, "")
    map_of_it = {f"tests/maps/straight/{name}" for name in ("map.json", "cone.obj", "finish-cone.obj", "floor.png")}
    assert written(out) == set(contents(empty)) == {"dodo.yml", "tests/first/first.dodo.yml", *map_of_it}
    assert "name it in dodo.yml: application: docker-compose.yml\n" in out
    assert dodo("compile", "--check") == FINE
    assert dodo("run", "first")[2] == f"dodo run: {NoApplication()}\n"


@pytest.mark.thorough
def test_a_folder_of_the_registry_is_made(repository: Path) -> None:
    (repository / "dodo.yml").write_text('dodo: 1\nregistry: ["dodo:", own/tests]\napplication: compose.yaml\n')
    code, out, _ = dodo("compile", "--check")
    assert (code, "hint: dodo new NAME makes it, with a first test" in out) == (2, True)
    assert "own/tests/first/first.dodo.yml" in written(dodo("new", "first")[1])
    assert "own/tests'" not in dodo("compile", "--check")[1]


@pytest.mark.parametrize(
    ("registry", "said"),
    [
        ('registry: ["dodo:"]', 'dodo.yml names no folder for your own tests; add to it: registry: [tests, "dodo:"]'),
        ("registry: [../theirs]", 'dodo.yml names no folder for your own tests; add to it: registry: [tests, "dodo:"]'),
        ("registri: [tests]", "dodo.yml has problems:\n  dodo.yml:2:1: error[unknown-key]: unknown key 'registri'\n"),
    ],
)
@pytest.mark.thorough
def test_a_deployment_that_takes_no_test_is_left_alone(empty: Path, registry: str, said: str) -> None:
    (empty / "dodo.yml").write_text(f"dodo: 1\n{registry}\n")
    before = contents(empty)
    code, out, err = dodo("new", "first")
    assert (code, out, err.startswith(f"dodo new: {said}"), contents(empty)) == (2, "", True, before)


SHIPPED = sorted(path.parent.name for path in package_data.registry().glob("*/*.dodo.yml"))
FEW = ("dil-kiwi-track", "hil-closed-oval", "sil-closed-two-cars", "sil-perception")
"""With each kind of file that a test refers to, and one that extends another."""


@pytest.mark.parametrize("shipped", [s if s in FEW else pytest.param(s, marks=pytest.mark.proof) for s in SHIPPED])
@pytest.mark.thorough
def test_a_shipped_test_is_copied_with_what_it_refers_to(repository: Path, shipped: str) -> None:
    code, out, err = dodo("new", "my-own", "--extends", shipped)
    assert (code, err) == (0, "")
    assert f"copied, because '{shipped}' ships with DoDo" in out
    code, out, err = dodo("compile", "--check")
    assert (code, err, "unused-placeholder" in out) == (0, "", False), out
    copies = load([repository / "tests"]).specs
    assert {copy.name for copy in copies} == {"my-own"}
    theirs = load([package_data.registry() / shipped]).specs
    for copy, spec in zip(copies, theirs, strict=True):
        assert (copy.level, copy.kind, copy.rig, copy.timeout_s) == (spec.level, spec.kind, spec.rig, spec.timeout_s)
        uses = [[(u.name, u.uses.text, list(u.parameters)) for u in each.uses] for each in (copy, spec)]
        assert uses[0] == uses[1]


@pytest.mark.thorough
def test_a_copy_leaves_the_map_that_is_there(repository: Path) -> None:
    dodo("new", "first")
    place = repository / "tests/maps/straight/map.json"
    place.write_text(place.read_text() + "\n")
    before = contents(repository / "tests/maps")
    assert dodo("new", "second", "--extends", "sil-closed-straight")[0] == 0
    assert contents(repository / "tests/maps") == before


@pytest.mark.thorough
def test_nothing_is_written_into_an_installed_dodo(repository: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    bundled = repository / ".venv/lib/python3/site-packages/dodo_dsl/_data"
    for name in ("schemas", "templates", "services", "tests_registry"):
        shutil.copytree(package_data.root() / name, bundled / name, ignore=shutil.ignore_patterns("__pycache__"))
    monkeypatch.setattr(package_data, "root", lambda: bundled)
    deployment = repository / "dodo.yml"
    deployment.write_text(deployment.read_text().replace("[tests]", '["dodo:", tests]'))
    before = contents(bundled)
    for words in (["first"], ["second", "--extends", "sil-closed-straight"]):
        assert dodo("new", *words)[::2] == (0, "")
    assert contents(bundled) == before
    deployment.write_text(deployment.read_text().replace(", tests]", "]"))
    assert "dodo.yml names no folder for your own tests; " in dodo("new", "third")[2]


@pytest.mark.parametrize(
    ("command", "kind", "made"),
    [
        ("--name=img.argb --width=1280", "closed-loop", {"name.argb": "img.argb", "width": 1280}),
        ("--name.bgr=video0.bgr", "open-loop", {"name.bgr": "video0.bgr"}),
        ("--name=video0.argb --name.i420=/video0.i420", "open-loop", {}),
    ],
)
@pytest.mark.thorough
def test_pictures_are_as_the_application_asks_for_them(
    repository: Path, command: str, kind: str, made: dict[str, Any]
) -> None:
    (repository / "compose.yaml").write_text(COMPOSE.replace("--cid=111", f"--cid=111 {command}"))
    assert "camera settings taken from service 'app': " in dodo("new", "mine", "--kind", kind)[1]
    camera = yaml.safe_load((repository / "tests/mine/mine.dodo.yml").read_text())["environment"]["camera"]["with"]
    assert {key: value for key, value in camera.items() if key not in ("map-path", "freq", "z")} == made
    assert "warning[application-" not in dodo("compile", "--check")[1]


STARTERS = {
    "python": (),
    "cpp": ("--language", "cpp"),
    "ros": ("--ros",),
}


@pytest.mark.parametrize("words", STARTERS.values(), ids=STARTERS)
def test_an_application_is_written_with_its_test_and_no_pipeline(empty: Path, words: tuple[str, ...]) -> None:
    (empty / ".gitignore").write_text("mine\n")
    code, out, err = dodo("new", "--application", *words)
    assert (code, err) == (0, "")
    assert written(out) == contents(empty).keys() - {".gitignore"}
    assert {"steering.py", "steering.cpp"} & written(out)
    assert not [name for name in written(out) if "gitlab" in name or "schema" in name or "README" in name]
    assert (empty / ".gitignore").read_text() == "mine\n"
    assert dodo("compile", "--check") == FINE


def test_the_application_is_that_of_its_page(empty: Path) -> None:
    dodo("new", "--application")
    assert (empty / "steering.py").read_text() == PROGRAM


def test_an_application_in_c_plus_plus_has_what_builds_it(empty: Path) -> None:
    _, out, _ = dodo("new", "--application", "--language", "cpp")
    steps = ("cmake -B build", "cmake --build build --parallel --target steering", "dodo run sil-first")
    assert "next: " + "\n      ".join(steps) + "\n" in out
    (service,) = yaml.safe_load((empty / "docker-compose.yml").read_text())["services"].values()
    standard = {definition.name: definition for definition in odvd.load(STANDARD)}
    own = {definition.name: definition for definition in odvd.load(empty / "messages.odvd")}
    assert sorted(own) == sorted(service["x-dodo"]["out"])
    assert all(definition.same_layout(standard[name]) for name, definition in own.items())


@pytest.mark.slow
@pytest.mark.parametrize("is_there", [True, False])
def test_libcluon_is_the_header_beside_the_program_or_is_fetched(
    empty: Path, is_there: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Which way CMake goes, with a header and a repository that hold nothing."""
    if not shutil.which("cmake"):
        pytest.skip("cmake is not installed")
    assert dodo("new", "--application", "--language", "cpp")[0] == 0
    if is_there:
        (empty / "cluon-complete.hpp").write_text("#pragma once\n")
    for name in ("CMAKE_GENERATOR", "CXX"):
        monkeypatch.delenv(name, raising=False)
    command = ["cmake", "-B", "build", f"-DLIBCLUON={empty / 'nowhere.git'}"]
    result = subprocess.run(command, cwd=empty, capture_output=True, text=True, check=False, timeout=120)
    said = result.stdout + result.stderr
    assert (result.returncode == 0, "nowhere.git" in said) == (is_there, not is_there), said
    assert (empty / "build/cluon-msc.cpp").exists() is is_there


def run_tests(folder: Path) -> str:
    command = [sys.executable, "-m", "dodo_dsl", "run"]
    environment = {**os.environ, "PYTHONPATH": str(package_data.root()), "DODO_LEASES": str(folder / "leases")}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False, timeout=300)
    return done.stdout + done.stderr


PASSED = re.compile(r"^PASSED  sil-first +[0-9.]+ s .* wall-margin 0", re.MULTILINE)


@pytest.mark.slow
def test_the_application_passes_its_test(empty: Path) -> None:
    assert dodo("new", "--application")[0] == 0
    said = run_tests(empty)
    assert PASSED.search(said), said


@pytest.mark.slow
@pytest.mark.parametrize(
    "always", ["0.005", *(pytest.param(v, marks=pytest.mark.proof) for v in ("0", "0.01", "-0.1"))]
)
def test_a_blind_program_passes_none_of_the_first_tests(empty: Path, always: str) -> None:
    """At 0.005 rad it would come along a straight track from a start that is only askew."""
    assert dodo("new", "--application")[0] == dodo("new", "sil-open", "--kind", "open-loop")[0] == 0
    (empty / "steering.py").write_text(PROGRAM.replace("-(left + right)", always))
    said = run_tests(empty)
    assert re.search(r"^FAILED  sil-first +hit wall ", said, re.MULTILINE), said
    assert re.search(r"^FAILED  sil-open +the share of frames with the sign of the target is 0", said, re.MULTILINE)


@pytest.mark.slow
@pytest.mark.proof
def test_the_application_in_c_plus_plus_passes_its_test(empty: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With libcluon as a header, ``LIBCLUON_HEADER=.../cluon-complete.hpp``."""
    header = os.environ.get("LIBCLUON_HEADER")
    if not header or not shutil.which("cmake") or not shutil.which("g++"):
        pytest.skip("LIBCLUON_HEADER names no cluon-complete.hpp, or cmake or g++ is not installed")
    for name in ("CMAKE_GENERATOR", "CXX"):
        monkeypatch.delenv(name, raising=False)
    assert dodo("new", "--application", "--language", "cpp")[0] == 0
    shutil.copy(header, empty / "cluon-complete.hpp")
    for words in (["-B", "build"], ["--build", "build", "--target", "steering"]):
        subprocess.run(["cmake", *words], check=True, capture_output=True, timeout=600)
    said = run_tests(empty)
    assert PASSED.search(said), said


@pytest.mark.parametrize("there", ["compose.yaml", "steering.py", "Dockerfile", "dodo.yml"])
def test_an_application_that_is_there_stays(empty: Path, there: str) -> None:
    (empty / there).write_text("mine")
    code, out, err = dodo("new", "--application")
    assert (code, out, contents(empty)) == (2, "", {there: b"mine"})
    assert err.startswith(f"dodo new: '{there}' exists already; nothing was written")


def test_a_deployment_is_written_once_and_keeps_what_there_is(repository: Path) -> None:
    before = contents(repository)
    code, out, err = dodo("new", "--deployment")
    assert (code, err) == (0, "")
    pipeline = {f".gitlab/dodo/{name}.gitlab-ci.yml" for name in package_data.PIPELINES}
    assert written(out) == {".gitlab-ci.yml", ".gitignore", *pipeline}
    assert before.items() <= contents(repository).items()
    everything = contents(repository)
    code, out, err = dodo("new", "--deployment")
    assert (code, err, written(out), out.count("kept: ")) == (0, "", set(), len(everything))
    assert (contents(repository), "add to .gitlab-ci.yml" in out) == (everything, False)


@pytest.mark.thorough
def test_a_compose_file_that_is_there_is_named_and_its_stack_left_out(empty: Path) -> None:
    view = "view: {image: opendlv-vehicle-view}, dec: {image: 'h264decoder:v1'}"
    (empty / "compose.yaml").write_text(COMPOSE.replace("{app", f"{{{view}, app"))
    assert "name it in" not in dodo("new", "first")[1]
    application = yaml.safe_load((empty / "dodo.yml").read_text())["application"]
    assert application == {"files": ["compose.yaml"], "without": ["view", "dec"]}
    assert dodo("compile") == (0, "1 test compiled into generated\n", "")


def test_an_empty_folder_gets_a_compose_file_to_fill_in(empty: Path) -> None:
    code, out, err = dodo("new", "--deployment")
    assert (code, err, "next: name your services in docker-compose.yml\n" in out) == (0, "", True)
    dodo("new", "first")
    assert dodo("compile")[0] == 0
    application = (empty / "generated/first/application.compose.yml").read_text()
    assert "${DODO_IMAGE_APPLICATION:-registry.example.org/group/application:latest}" in application


def test_a_pipeline_that_is_there_is_told_what_to_add(repository: Path) -> None:
    own = "lint: {script: [make lint]}\n"
    (repository / ".gitlab-ci.yml").write_text(own)
    _, out, _ = dodo("new", "--deployment")
    shown = out.partition("add to .gitlab-ci.yml:\n")[2].partition("\n      dodo new")[0]
    (entry,) = yaml.safe_load(shown)["include"]
    assert Path(entry["local"]).name == "tests.gitlab-ci.yml"
    assert entry["inputs"] == {"stage": "test", "images": False}
    assert (repository / ".gitlab-ci.yml").read_text() == own


LINES = {
    "parts": "straight 1 m, left 45 deg radius 1 m, right 45 deg radius 80 cm",
    "points": "points.csv",
    "lap": "straight 2 m, left 180 deg radius 1 m, straight 2 m, left 180 deg radius 1 m",
}


@pytest.mark.parametrize("line", LINES)
@pytest.mark.thorough
def test_a_map_of_a_centre_line_is_one_that_a_test_takes(repository: Path, line: str) -> None:
    (repository / "points.csv").write_text("x,y\n1,0\n1,1\n1.05,1.02\n2,2\n4,2\n")
    words = ["--map", "track", "--line", LINES[line], "--width", "60 cm", *["--lap"] * (line == "lap")]
    code, out, err = dodo("new", *words)
    assert (code, err) == (0, "")
    (x, y, yaw) = re.findall(r"x: (\S+) m, y: (\S+) m, yaw: (\S+) deg ", out)[0]
    assert (x, y, yaw) == ("1" if line == "points" else "0", "0", "90")
    assert dodo("new", "first")[0] == 0
    spec = repository / "tests/first/first.dodo.yml"
    text = (
        spec.read_text().replace("maps/straight", "maps/track").replace("yaw: 70 deg  ", f"x: {x} m\n      yaw: 90 deg")
    )
    spec.write_text(text)
    assert dodo("compile", "--check") == FINE
    found = yaml.safe_load((repository / "tests/maps/track/map.json").read_text())
    names = {"left", "right", "finish", "behind", *(() if line == "lap" else ("beyond",))}
    assert {each["name"] for each in found["obstacles"]} == names
    yellow, blue = (part["instances"] for part in found["model"][:2])
    assert yellow[0][:2] == pytest.approx([float(x) - 0.3, blue[0][1]])
    assert blue[0][0] - yellow[0][0] == pytest.approx(0.6)
