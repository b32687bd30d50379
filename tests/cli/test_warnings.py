"""What is said about a test that runs: its own problems and warnings, and not those of others."""

import json
from collections.abc import Iterable
from pathlib import Path

import pytest

from dodo_dsl.cli.selection import select
from dodo_dsl.compiler import Checked
from dodo_dsl.diagnostics import Diagnostic, Span, format_gitlab, format_json, format_text, has_errors
from tests.check import examples

GOOD = """\
dodo: 1
name: {name}
description: d.
level: sil
kind: closed-loop
timeout: 60 s
matrix: {{freq: [10 Hz, 20 Hz]}}
environment: {{camera: {{uses: virtual-camera, with: {{map-path: ../maps/{map}, freq: "${{matrix.freq}}"}}}}}}
action: {{vehicle: {{uses: dynamic-model}}, pose: {{uses: {pose}}}}}
evaluation: {{track: {{uses: collision, with: {{goal: finish}}}}}}
"""
APPLICATION = """\
services:
  driver:
    image: x
    command: --cid=111
    x-dodo:
      in: [opendlv.proxy.DistanceReading]
      out: [opendlv.proxy.GroundSteeringRequest, opendlv.proxy.PedalPositionRequest]
"""


@pytest.fixture
def repository(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Good tests, and one of each kind of fault, which none of the good ones has."""
    examples.write("", tmp_path)
    monkeypatch.chdir(tmp_path)
    _write(tmp_path, "docker-compose.yml", APPLICATION)
    _write(tmp_path, "dodo.yml", "dodo: 1\nregistry: [tests]\nservices: [own]\napplication: docker-compose.yml\n")
    _write(tmp_path, "own/mine/service.yml", "name: mine\nlayers: [action]\n")
    map_ = (tmp_path / "tests/maps/plain/map.json").read_text()
    _write(tmp_path, "tests/maps/bent/map.json", map_.replace("finish", ""))
    _write(tmp_path, "tests/bases/base.dodo.yml", _test("base").replace("goal", "gaol"))
    for name in ("good", "better", "second"):
        _write(tmp_path, f"tests/{name}/{name}.dodo.yml", _test(name))
    _write(tmp_path, "tests/unread/unread.dodo.yml", "dodo: [1")
    _write(tmp_path, "tests/misspelt/misspelt.dodo.yml", _test("misspelt").replace("level", "levle"))
    _write(tmp_path, "tests/based/based.dodo.yml", "dodo: 1\nname: based\nextends: ../bases/base.dodo.yml\n")
    _write(tmp_path, "tests/mapped/mapped.dodo.yml", _test("mapped", map_="bent"))
    _write(tmp_path, "tests/lost/lost.dodo.yml", _test("lost", pose="mine"))
    _write(tmp_path, "tests/fast/fast.dodo.yml", _test("fast").replace("20 Hz", "2000 Hz"))
    return tmp_path


def _write(folder: Path, name: str, text: str) -> None:
    (folder / name).parent.mkdir(parents=True, exist_ok=True)
    (folder / name).write_text(text)


def _test(name: str, map_: str = "plain", pose: str = "integrator") -> str:
    return GOOD.format(name=name, map=map_, pose=pose)


def _said(checked: Checked) -> list[str]:
    return [f"{Path(d.span.file).name} {d.severity}" for d in checked.diagnostics]


@pytest.mark.parametrize("words", [["good"], ["good", "better"], ["tests/good"], ["good[freq=10 Hz]"]])
@pytest.mark.usefixtures("repository")
def test_a_good_test_runs_whatever_others_have(words: list[str]) -> None:
    checked = select(words, (), ())
    assert _said(checked) == ["docker-compose.yml warning"], checked.diagnostics
    names = {word.removeprefix("tests/").partition("[")[0] for word in words}
    assert set(checked.diagnostics[0].tests) == names


@pytest.mark.parametrize(
    ("word", "file"),
    [
        ("unread", "unread.dodo.yml"),
        ("misspelt", "misspelt.dodo.yml"),
        ("based", "base.dodo.yml"),
        ("mapped", "map.json"),
        ("lost", "service.yml"),
        ("fast", "fast.dodo.yml"),
        ("fast[freq=2000 Hz]", "fast.dodo.yml"),
        ("[f-m]*[a-z]", "map.json"),
    ],
)
@pytest.mark.usefixtures("repository")
def test_each_fault_stops_the_test_that_has_it(word: str, file: str) -> None:
    assert f"{file} error" in _said(select([word], (), ()))


@pytest.mark.usefixtures("repository")
@pytest.mark.thorough
def test_a_fault_of_one_instance_does_not_stop_another() -> None:
    assert not has_errors(select(["fast[freq=10 Hz]"], (), ()).diagnostics)


@pytest.mark.usefixtures("repository")
def test_all_tests_have_all_problems() -> None:
    files = {"unread.dodo.yml", "misspelt.dodo.yml", "base.dodo.yml", "map.json", "service.yml", "fast.dodo.yml"}
    assert {said.split()[0] for said in _said(select([], (), ()))} >= files


@pytest.mark.usefixtures("repository")
@pytest.mark.thorough
def test_a_test_whose_level_cannot_be_read_is_not_left_out_by_level() -> None:
    assert "misspelt.dodo.yml error" in _said(select([], ["sil"], ()))


def _of(tests: Iterable[str]) -> Diagnostic:
    return Diagnostic(Span("compose.yml"), "application-input", "nobody sends it.", severity="warning", tests=(*tests,))


@pytest.mark.parametrize(
    ("tests", "said"),
    [
        ([], "nobody sends it."),
        (["a"], "nobody sends it (in a)"),
        (["a", "b", "c"], "nobody sends it (in a, b and c)"),
        ([f"t{number}" for number in range(20)], "nobody sends it (in 20 tests, such as t0)"),
    ],
)
def test_one_warning_of_several_tests_is_shown_once_with_their_names_or_number(tests: list[str], said: str) -> None:
    found = [_of(tests)]
    assert f"warning[application-input]: {said}\n" in format_text(found)
    (as_json,), (as_report,) = json.loads(format_json(found)), json.loads(format_gitlab(found))
    assert (as_json["tests"], as_report["description"]) == (tests, said)
    assert as_report["fingerprint"] == json.loads(format_gitlab([_of([])]))[0]["fingerprint"]
