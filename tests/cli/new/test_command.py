"""``dodo new``: what it writes compiles at once, and nothing that is there changes."""

import os
import re
import shutil
import subprocess
import sys
import textwrap
from io import StringIO
from pathlib import Path
from typing import Any

import pytest
import yaml

from dodo_dsl import package_data
from dodo_dsl.cli.main import main
from dodo_dsl.cli.new_files import LANGUAGES
from dodo_dsl.cli.new_test import kinds
from dodo_dsl.compiler import NoApplication, load
from dodo_dsl.opendlv import odvd
from dodo_dsl.opendlv.odvd import STANDARD
from dodo_dsl.spec.model import LEVELS
from tests.cli.terminal import Terminal
from tests.test_documentation import PROGRAM


def dodo(*words: str) -> tuple[int, str, str]:
    stdout, stderr = StringIO(), StringIO()
    code = main(words, stdout, stderr)
    return code, stdout.getvalue(), stderr.getvalue()


@pytest.fixture
def empty(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def repository(empty: Path) -> Path:
    code, out, err = dodo("new", "--deployment")
    assert (code, err) == (0, ""), out
    return empty


def contents(folder: Path) -> dict[str, bytes]:
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


DETECTIONS = [f"opendlv.logic.perception.Detection{part}" for part in ("Type", "Property", "BoundingBox")]
DECLARED = f"{{in: [], out: [{', '.join(DETECTIONS)}], answers: [{DETECTIONS[2]}]}}"
PERCEPTION = f"services: {{app: {{image: example, command: --cid=111, x-dodo: {DECLARED}}}}}\n"
KINDS = [(level, kind) for level in LEVELS for kind in kinds(level)]


@pytest.mark.parametrize(("level", "kind"), [(None, None), *KINDS])
@pytest.mark.thorough
def test_a_new_test_compiles_at_once(repository: Path, level: str | None, kind: str | None) -> None:
    options = [*(("--level", level) if level else ()), *(("--kind", kind) if kind else ())]
    code, out, err = dodo("new", "my-test", *options)
    assert (code, err) == (0, "")
    assert "wrote tests/my-test/my-test.dodo.yml\n" in out
    if kind == "perception":  # the application that the repository began with steers
        (repository / "docker-compose.yml").write_text(PERCEPTION)
    code, out, err = dodo("compile", "--check")
    assert (code, err, out.partition(" checked: ")[2]) == (0, "", "no problems\n")
    spec = yaml.safe_load((repository / "tests/my-test/my-test.dodo.yml").read_text())
    assert (spec["level"], spec["kind"]) == (level or "sil", kind or "closed-loop")
    assert (repository / "tests/my-test/README.md").read_text().startswith("# my-test\n")
    assert dodo("compile")[0] == 0


@pytest.mark.thorough
def test_a_new_test_may_extend_another(repository: Path) -> None:
    assert dodo("new", "first")[0] == dodo("new", "second", "--extends", "first")[0] == 0
    assert dodo("compile", "--check") == (0, "2 tests checked: no problems\n", "")
    spec = yaml.safe_load((repository / "tests/second/second.dodo.yml").read_text())
    assert spec["extends"] == "../first/first.dodo.yml"


@pytest.mark.thorough
def test_editors_find_the_schema(repository: Path) -> None:
    dodo("new", "first")
    line = (repository / "tests/first/first.dodo.yml").read_text().splitlines()[0]
    schema = repository / "tests/first" / line.partition("$schema=")[2]
    assert '"title": "DoDo test"' in schema.read_text()


BEGINNINGS: list[tuple[list[str], str]] = [
    (["First"], "'First' is not a valid test name, expected lower-case letters and digits in words joined by"),
    (["../first"], "'../first' is not a valid test name"),
    (["a" * 61], "at most 60 characters"),
    (["variables"], "'variables' is a keyword of GitLab's pipelines"),
    (["there"], "there is a test 'there' already; names are unique over all registries"),
    (["half"], "'tests/half/README.md' exists already; nothing was written"),
    (["new", "--extends", "their"], "unknown test 'their' to extend; did you mean 'there'?"),
    (["new", "--extends", "there", "--level", "hil"], "--level, --kind and --rec do not apply with --extends"),
    (["new", "--level", "dil"], "a dil test cannot be closed-loop"),
    (["new", "--level", "dil"], "; try: dodo new new --level dil --kind open-loop"),
    (["--deployment", "--level", "hil"], "--level, --kind, --extends and --rec apply to a test"),
]


@pytest.mark.thorough
def test_what_cannot_be_begun_is_said_and_writes_nothing(repository: Path) -> None:
    assert dodo("new", "there")[0] == 0
    (repository / "tests/half").mkdir()
    (repository / "tests/half/README.md").write_text("mine")
    before = contents(repository)
    for words, said in BEGINNINGS:
        code, out, err = dodo("new", *words)
        assert (code, out) == (2, ""), words
        assert err.startswith("dodo new: ")
        assert said in err
        assert err.count("\n") == 1
        assert contents(repository) == before


@pytest.mark.parametrize(("level", "kind"), [("sil", "perception"), ("dil", "open-loop"), ("hil", "open-loop")])
def test_what_no_template_is_for_begins_as_a_copy(repository: Path, level: str, kind: str) -> None:
    code, out, err = dodo("new", "mine", "--level", level, "--kind", kind)
    assert (code, err) == (0, "")
    assert f", because a {level} test of kind {kind} needs " in out
    spec = load([repository / "tests"]).specs[0]
    assert (spec.name, spec.level, spec.kind) == ("mine", level, kind)


@pytest.mark.thorough
def test_an_empty_folder_becomes_a_repository(empty: Path) -> None:
    code, out, err = dodo("new", "first")
    assert (code, err) == (0, "")
    written = {line.removeprefix("wrote ") for line in out.splitlines() if line.startswith("wrote ")}
    assert written == set(contents(empty))
    assert {
        "dodo.yml",
        ".dodo/dodo.schema.json",
        "tests/first/first.dodo.yml",
        "tests/maps/straight/map.json",
    } < written
    assert "name it in dodo.yml: application: docker-compose.yml\n" in out
    assert "dodo new --application, in an empty folder, writes a first application" in out
    assert dodo("compile", "--check") == (0, "1 test checked: no problems\n", "")
    assert dodo("new", "second")[0] == 0
    assert dodo("run", "first")[2] == f"dodo run: {NoApplication()}\n"


@pytest.mark.thorough
def test_an_application_that_is_there_is_named(empty: Path) -> None:
    (empty / "compose.yaml").write_text("services: {app: {image: example, command: --cid=111}}\n")
    assert "name it in" not in dodo("new", "first")[1]
    assert yaml.safe_load((empty / "dodo.yml").read_text())["application"] == "compose.yaml"
    assert dodo("compile") == (0, "1 test compiled into generated\n", "")


@pytest.mark.thorough
def test_a_folder_of_the_registry_is_made(empty: Path) -> None:
    (empty / "dodo.yml").write_text('dodo: 1\nregistry: ["dodo:", own/tests]\napplication: docker-compose.yml\n')
    code, out, _ = dodo("compile", "--check")
    assert code == 2
    assert "there is no folder 'own/tests'\n" in out
    assert "hint: dodo new NAME makes it, with a first test; paths are relative to the folder of dodo.yml\n" in out
    code, out, err = dodo("new", "first")
    assert (code, err) == (0, "")
    assert "wrote own/tests/first/first.dodo.yml\n" in out
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
    assert (code, out) == (2, "")
    assert err.startswith(f"dodo new: {said}")
    assert contents(empty) == before


@pytest.mark.thorough
def test_without_a_name_it_lists_what_there_is(empty: Path) -> None:
    code, out, err = dodo("new")
    assert (code, err, list(empty.iterdir())) == (2, "", [])
    rows = {row[0].strip(): row[2] for line in out.splitlines() if (row := line.strip().partition("  "))[1]}
    assert {words for words in rows if words.startswith("--level")} == {
        f"--level {level} --kind {kind}" for level, kind in KINDS
    }
    assert [words.split()[1] for words in rows if words.startswith("--extends")] == SHIPPED


def asked(patch: pytest.MonkeyPatch, answers: str, *words: str) -> tuple[int, str, str]:
    """What it does in a terminal."""
    stdin, stdout, stderr = Terminal(answers), Terminal(), StringIO()
    patch.setattr(sys, "stdin", stdin)
    return main(["new", *words], stdout, stderr), stdout.getvalue(), stderr.getvalue()


@pytest.mark.parametrize(
    ("answers", "words", "expected"),
    [
        ("\n\n\n\n", [], ("sil-first", "sil", "closed-loop", False)),
        ("1\nopen-loop\n2\nmine\n", [], ("mine", "sil", "open-loop", True)),
        ("9\nhil\n3\n1\nBad\nfine\n", [], ("fine", "hil", "perception", True)),
        ("\n\nmine\n", ["--level", "dil"], ("mine", "dil", "open-loop", True)),
        ("\n", ["--extends", "sil-open-straight"], ("my-sil-open-straight", "sil", "open-loop", True)),
    ],
)
@pytest.mark.thorough
def test_in_a_terminal_it_asks(
    empty: Path, monkeypatch: pytest.MonkeyPatch, answers: str, words: list[str], expected: tuple[str, str, str, bool]
) -> None:
    code, out, err = asked(monkeypatch, answers, *words)
    assert (code, err) == (0, ""), out
    (spec,) = {spec.path: spec for spec in load([empty / "tests"]).specs}.values()
    assert (spec.name, spec.level, spec.kind, "copied" in out) == expected
    assert ("'9' is none of them, expected a number from 1 to 3\n" in out) is ("9" in answers)
    assert ("'Bad' is not a valid test name" in out) is ("Bad" in answers)


@pytest.mark.thorough
def test_who_answers_no_more_gets_nothing(empty: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    code, _, err = asked(monkeypatch, "1\n")
    assert (code, list(empty.iterdir())) == (2, [])
    assert err == "dodo new: nothing was written: the input ended before all questions were answered\n"


def with_shipped(repository: Path, registry: str = '["dodo:", tests]') -> None:
    deployment = repository / "dodo.yml"
    deployment.write_text(deployment.read_text().replace("[tests]", registry))


def installed_in(repository: Path, patch: pytest.MonkeyPatch) -> Path:
    """A wheel's data in a virtual environment that lies in the repository."""
    bundled = repository / ".venv/lib/python3/site-packages/dodo_dsl/_data"
    for name in ("schemas", "templates", "services", "tests_registry"):
        shutil.copytree(package_data.root() / name, bundled / name, ignore=shutil.ignore_patterns("__pycache__"))
    patch.setattr(package_data, "root", lambda: bundled)
    return bundled


SHIPPED = sorted(path.parent.name for path in package_data.registry().glob("*/*.dodo.yml"))
FEW = ("dil-kiwi-track", "hil-perception", "sil-closed-left-curve", "sil-closed-two-cars", "sil-perception")
"""With each kind of file that a test refers to: a recording, a target, a map, one of its own, classes."""


@pytest.mark.parametrize("shipped", [s if s in FEW else pytest.param(s, marks=pytest.mark.proof) for s in SHIPPED])
@pytest.mark.thorough
def test_a_shipped_test_is_copied_with_what_it_refers_to(repository: Path, shipped: str) -> None:
    (repository / "docker-compose.yml").write_text("services: {anything: {image: example, command: --cid=111}}\n")
    code, out, err = dodo("new", "my-own", "--extends", shipped)
    assert (code, err) == (0, "")
    assert f"copied, because '{shipped}' ships with DoDo" in out
    code, out, err = dodo("compile", "--check")
    assert (code, err) == (0, ""), out
    assert "vary-unused" not in out
    spec = yaml.safe_load((repository / "tests/my-own/my-own.dodo.yml").read_text())
    assert (spec["name"], "extends" in spec) == ("my-own", False)
    text = (repository / "tests/my-own/my-own.dodo.yml").read_text()
    for path in re.findall(r"\.\./[\w./-]+", text.partition("dodo: 1")[2]):
        assert (repository / "tests/my-own" / path).exists(), path


@pytest.mark.thorough
def test_a_copy_is_the_same_test(repository: Path) -> None:
    dodo("new", "mine", "--extends", "hil-dynamic")
    dodo("new", "further", "--extends", "mine")
    (shipped,) = load([package_data.registry() / "hil-dynamic"]).specs
    copies = load([repository / "tests"]).specs
    assert [spec.name for spec in copies] == ["further", "mine"]
    for copy in copies:
        assert (copy.level, copy.kind, copy.rig, copy.timeout_s) == ("hil", "closed-loop", "dynamic", 60.0)
        assert [(u.name, u.uses.text, list(u.parameters)) for u in copy.uses] == [
            (u.name, u.uses.text, list(u.parameters)) for u in shipped.uses
        ]


@pytest.mark.thorough
def test_a_copy_leaves_the_map_that_is_there(repository: Path) -> None:
    dodo("new", "first")
    place = repository / "tests/maps/straight/map.json"
    place.write_text(place.read_text() + "\n")
    before = contents(repository / "tests/maps")
    assert dodo("new", "second", "--extends", "sil-closed-straight")[0] == 0
    assert contents(repository / "tests/maps") == before


@pytest.mark.parametrize("words", [[], ["--extends", "sil-closed-straight"]])
@pytest.mark.thorough
def test_nothing_is_written_into_an_installed_dodo(
    repository: Path, monkeypatch: pytest.MonkeyPatch, words: list[str]
) -> None:
    with_shipped(repository)
    bundled = installed_in(repository, monkeypatch)
    before = contents(bundled)
    code, out, err = dodo("new", "first", *words)
    assert (code, err) == (0, "")
    assert "wrote tests/first/first.dodo.yml\n" in out
    assert contents(bundled) == before


@pytest.mark.thorough
def test_an_installed_dodo_is_no_folder_of_the_repository(repository: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with_shipped(repository, '["dodo:"]')
    installed_in(repository, monkeypatch)
    code, out, err = dodo("new", "first")
    assert (code, out) == (2, "")
    assert err.startswith("dodo new: dodo.yml names no folder for your own tests; ")


def test_an_application_is_written_with_its_test(empty: Path) -> None:
    (empty / ".gitignore").write_text("mine\n")
    code, out, err = dodo("new", "--application")
    assert (code, err) == (0, "")
    assert {line.removeprefix("wrote ") for line in out.splitlines() if line.startswith("wrote ")} == {
        *contents(empty).keys() - {".gitignore"}
    }
    assert (empty / "steering.py").read_text() == PROGRAM
    assert (empty / ".gitignore").read_text() == "mine\n"
    assert dodo("compile", "--check") == (0, "1 test checked: no problems\n", "")


def test_an_application_in_c_plus_plus_has_what_builds_it(empty: Path) -> None:
    code, out, err = dodo("new", "--application", "--language", "cpp")
    assert (code, err) == (0, "")
    assert (
        "next: cmake -B build\n      cmake --build build --parallel --target steering\n      dodo run sil-first\n"
        in out
    )
    assert {"CMakeLists.txt", "Dockerfile", "messages.odvd", "steering.cpp"} < set(contents(empty))
    (service,) = yaml.safe_load((empty / "docker-compose.yml").read_text())["services"].values()
    assert service["x-dodo-process"] == ["build/steering"]
    assert "build/" in (empty / ".gitignore").read_text().splitlines()
    (included,) = yaml.safe_load((empty / ".gitlab-ci.yml").read_text())["include"]
    assert (Path(included["local"]).name, included["inputs"]["images"]) == ("tests.gitlab-ci.yml", True)
    assert dodo("compile", "--check") == (0, "1 test checked: no problems\n", "")
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


def test_language_and_answers_are_those_of_an_application(empty: Path) -> None:
    assert dodo("new", "first", "--language", "cpp") == (2, "", "dodo new: --language applies to --application\n")
    assert dodo("new", "--deployment", "--answers", "printed")[2] == "dodo new: --answers applies to --application\n"


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("answers", ["printed", "wheels"])
def test_an_application_may_print_or_drive_by_two_wheels(empty: Path, language: str, answers: str) -> None:
    code, _, err = dodo("new", "--application", "--language", language, "--answers", answers)
    assert (code, err) == (0, "")
    (service,) = yaml.safe_load((empty / "docker-compose.yml").read_text())["services"].values()
    declared = yaml.safe_load((empty / "dodo.yml").read_text())["application"]
    if answers == "printed":
        assert not {"x-dodo", "x-dodo-process"} & service.keys()
        said = [line["message"] for line in declared["services"]["steering"]["lines"]]
        assert said == ["opendlv.proxy.GroundSteeringRequest", "opendlv.proxy.PedalPositionRequest"]
    else:
        assert service["x-dodo"]["out"] == [f"opendlv.proxy.PedalPositionRequest/{wheel}" for wheel in (0, 1)]
    own = (empty / "messages.odvd").exists()
    assert own is (answers == "wheels" and language == "cpp")
    if own:
        standard = {definition.name: definition for definition in odvd.load(STANDARD)}
        layouts = odvd.load(empty / "messages.odvd")
        assert {each.name for each in layouts} == {
            "opendlv.proxy.DistanceReading",
            "opendlv.proxy.PedalPositionRequest",
        }
        assert all(each.same_layout(standard[each.name]) for each in layouts)
    assert dodo("compile", "--check") == (0, "1 test checked: no problems\n", "")


def run_first(folder: Path) -> None:
    command = [sys.executable, "-m", "dodo_dsl", "run"]
    environment = {**os.environ, "PYTHONPATH": str(package_data.root()), "DODO_LEASES": str(folder / "leases")}
    result = subprocess.run(command, env=environment, capture_output=True, text=True, check=False, timeout=300)
    assert result.returncode == 0, result.stdout + result.stderr
    assert re.search(r"^PASSED  sil-first +[0-9.]+ s .* wall-margin 0", result.stdout, re.MULTILINE), result.stdout


@pytest.mark.slow
@pytest.mark.parametrize("answers", ["wheels", *(pytest.param(a, marks=pytest.mark.proof) for a in ("bus", "printed"))])
def test_the_application_passes_its_test(empty: Path, answers: str) -> None:
    assert dodo("new", "--application", "--answers", answers)[0] == 0
    if answers != "wheels":
        assert dodo("new", "sil-open", "--kind", "open-loop")[0] == 0
    run_first(empty)


BLIND = """\
import sys
from dodo_dsl.opendlv.session import Session
from dodo_dsl.opendlv.shared_memory import SharedMemory
flags = dict(word[2:].partition("=")[::2] for word in sys.argv[1:])
with SharedMemory.attach(flags["name"]) as memory, Session(int(flags["cid"])) as session:
    steer, pedal = (session.messages.type(f"opendlv.proxy.{n}Request") for n in ("GroundSteering", "PedalPosition"))
    while memory.wait():
        with memory.lock():
            sampled = memory.sample_time()
        session.send(steer(groundSteering=float(flags["always"])), sampled)
        session.send(pedal(position=0.1), sampled)
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    "always", ["0", "0.005", *(pytest.param(v, marks=pytest.mark.proof) for v in ("0.01", "-0.1"))]
)
def test_a_blind_program_passes_none_of_the_first_tests(empty: Path, always: str) -> None:
    """At 0.005 rad it would come along a straight track from a start that is only askew."""
    assert dodo("new", "--application")[0] == dodo("new", "sil-open", "--kind", "open-loop")[0] == 0
    (empty / "steering.py").write_text(BLIND)
    compose = empty / "docker-compose.yml"
    compose.write_text(compose.read_text().replace("video0.argb", f"video0.argb --always={always}"))
    command = [sys.executable, "-m", "dodo_dsl", "run"]
    environment = {**os.environ, "PYTHONPATH": str(package_data.root()), "DODO_LEASES": str(empty / "leases")}
    said = subprocess.run(command, env=environment, capture_output=True, text=True, check=False, timeout=300).stdout
    assert re.search(r"^FAILED  sil-first +hit wall ", said, re.MULTILINE), said
    assert re.search(r"^FAILED  sil-open +the share of frames with the sign of the target is 0", said, re.MULTILINE)


@pytest.mark.slow
@pytest.mark.proof
def test_the_application_in_c_plus_plus_passes_its_test(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With libcluon as a header, ``LIBCLUON_HEADER=.../cluon-complete.hpp``; its cluon-msc is built once."""
    header = os.environ.get("LIBCLUON_HEADER")
    if not header or not shutil.which("cmake") or not shutil.which("g++"):
        pytest.skip("LIBCLUON_HEADER names no cluon-complete.hpp, or cmake or g++ is not installed")
    for name in ("CMAKE_GENERATOR", "CXX"):
        monkeypatch.delenv(name, raising=False)
    for answers in ("bus", "printed", "wheels"):
        folder = tmp_path / answers
        folder.mkdir()
        monkeypatch.chdir(folder)
        assert dodo("new", "--application", "--language", "cpp", "--answers", answers)[0] == 0
        shutil.copy(header, folder / "cluon-complete.hpp")
        msc = tmp_path / "bus/build/cluon-msc"
        if answers == "wheels":  # what is built already
            cmake = folder / "CMakeLists.txt"
            cmake.write_text(cmake.read_text().replace("COMMAND cluon-msc", f"COMMAND {msc}"))
            cmake.write_text(cmake.read_text().replace("DEPENDS cluon-msc", "DEPENDS"))
        subprocess.run(["cmake", "-B", "build"], check=True, capture_output=True, timeout=300)
        build = ["cmake", "--build", "build", "--target", "steering"]
        subprocess.run(build, check=True, capture_output=True, timeout=600)
        run_first(folder)


@pytest.mark.parametrize("there", ["compose.yaml", "steering.py", "Dockerfile", "dodo.yml"])
def test_an_application_that_is_there_stays(empty: Path, there: str) -> None:
    (empty / there).parent.mkdir(parents=True, exist_ok=True)
    (empty / there).write_text("mine")
    code, out, err = dodo("new", "--application")
    assert (code, out, contents(empty)) == (2, "", {there: b"mine"})
    assert err.startswith(f"dodo new: '{there}' exists already; nothing was written")


def test_a_deployment_is_written_once(repository: Path) -> None:
    before = contents(repository)
    code, out, err = dodo("new", "--deployment")
    assert (code, err) == (0, "")
    assert out.endswith("\nnothing to write\n")
    assert out.count("kept: ") == len(before)
    assert contents(repository) == before


def test_a_deployment_names_compose_files_that_it_does_not_take(empty: Path) -> None:
    (empty / "simulation-task1.yml").write_text("version: '2'\nservices: {app: {image: example}}\n")
    (empty / "driver").mkdir()
    (empty / "driver/rover.yaml").write_text("services: {app: {image: example}}\n")
    (empty / "other.yml").write_text("my-services: 1\n")
    code, out, _ = dodo("new", "--deployment")
    said = "name your services in docker-compose.yml, or name those that you have in dodo.yml, of "
    assert code == 0
    assert f"{said}simulation-task1.yml, driver/rover.yaml: application: {{files: [...]}}\n" in out


def test_a_deployment_takes_the_compose_file_that_is_there(empty: Path) -> None:
    (empty / "compose.yml").write_text("services: {app: {image: example}}\n")
    (empty / ".gitlab-ci.yml").write_text("build: {script: [make]}\n")
    before = contents(empty)
    code, out, _ = dodo("new", "--deployment")
    assert code == 0
    assert before.items() <= contents(empty).items()
    assert not (empty / "docker-compose.yml").exists()
    assert yaml.safe_load((empty / "dodo.yml").read_text())["application"] == "compose.yml"
    assert pasted(out)["inputs"] == {"stage": "test"}


def pasted(said: str) -> dict[str, Any]:
    """What the lines say that are to be added to the pipeline."""
    text = said.partition("add to .gitlab-ci.yml:\n")[2].partition("dodo new sil-first")[0].partition("commit and")[0]
    (entry,) = yaml.safe_load(textwrap.dedent(text))["include"]
    return dict(entry)


OWN_PIPELINE = """\
stages: [build, deploy]
.build: {before_script: [!reference [.tools, script], make tools]}
compile:
  stage: build
  script: [!reference [.build, before_script], make]
"""


@pytest.mark.parametrize("what", ["--deployment", "--application"])
def test_what_meets_the_pipeline_that_is_there_is_told(empty: Path, what: str) -> None:
    (empty / ".gitlab-ci.yml").write_text(OWN_PIPELINE)
    (empty / ".gitignore").write_text("*.o\n/generated\n")
    code, out, err = dodo("new", what)
    assert (code, err) == (0, "")
    assert "kept: .gitignore, which lacks dodo-report/, gl-code-quality-report.json\n" in out
    assert pasted(out) == {"local": ".gitlab/dodo/tests.gitlab-ci.yml", "inputs": {"stage": "build"}}
    assert ("name your services in docker-compose.yml" in out) is (what == "--deployment")
    assert (empty / ".gitlab-ci.yml").read_text() == OWN_PIPELINE


@pytest.mark.parametrize(
    "text", ["a:stages: [\n", "spec: {}\n---\na: {script: [make]}\n", "stages: !reference [.all, stages]\n", ""]
)
def test_a_pipeline_that_says_no_stage_has_that_of_gitlab(empty: Path, text: str) -> None:
    (empty / ".gitlab-ci.yml").write_text(text)
    code, out, err = dodo("new", "--deployment")
    assert (code, err, pasted(out)["inputs"]) == (0, "", {"stage": "test"})


def test_who_has_included_the_templates_is_not_told_to(repository: Path) -> None:
    shutil.rmtree(repository / ".gitlab")
    (repository / "docker-compose.yml").write_text("services: {app: {image: example, command: --cid=111}}\n")
    out = dodo("new", "--deployment")[1]
    assert "wrote .gitlab/dodo/tests.gitlab-ci.yml\n" in out
    assert "kept: .gitignore\n" in out
    assert "include " not in out
    assert "name your services" not in out


@pytest.mark.thorough
def test_the_image_of_a_pipeline_reaches_the_compose_file(repository: Path) -> None:
    dodo("new", "first")
    assert dodo("compile")[0] == 0
    application = (repository / "generated/first/application.compose.yml").read_text()
    assert "${DODO_IMAGE_APPLICATION:-registry.example.org/group/application:latest}" in application


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("command", "kind", "made"),
    [
        (
            "--name=img.argb --width=1280 --height=720",
            "closed-loop",
            {"name.argb": "img.argb", "width": 1280, "height": 720},
        ),
        ("--name.bgr=video0.bgr", "open-loop", {"name.bgr": "video0.bgr", "width": 640, "height": 480}),
        ("--name=video0.argb --name.i420=/video0.i420", "open-loop", {"width": 640, "height": 480}),
    ],
)
def test_pictures_are_as_the_application_asks_for_them(empty: Path, command: str, kind: str, made: dict) -> None:
    (empty / "compose.yaml").write_text(f"services: {{app: {{image: example, command: --cid=111 {command}}}}}\n")
    (empty / "dodo.yml").write_text("dodo: 1\nregistry: [tests]\napplication: compose.yaml\n")
    assert dodo("new", "mine", "--kind", kind)[0] == 0
    camera = yaml.safe_load((empty / "tests/mine/mine.dodo.yml").read_text())["environment"]["camera"]["with"]
    assert {key: value for key, value in camera.items() if key not in ("map-path", "freq", "z")} == made
    assert "warning[application-" not in dodo("compile", "--check")[1]
