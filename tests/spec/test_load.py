"""Instances of a file at the nominal values of its ranges, at their ends, and at others."""

from pathlib import Path

from dodo_dsl.diagnostics import Diagnostic
from dodo_dsl.source import Scalar
from dodo_dsl.spec.load import load_spec
from dodo_dsl.spec.model import Spec
from dodo_dsl.spec.registry import Location
from tests.check import examples

TEXT = """\
matrix: {yaw: [80 deg, 90 deg]}
vary: {start: {from: -8 cm, to: "8 cm", nominal: 0 cm}, limit: {among: [60 s, 90 s, 2 min], nominal: 90 s}}
timeout: "${vary.limit}"
action:
  vehicle: {uses: dynamic-model}
  pose: {uses: integrator, with: {x: "${vary.start}", yaw: "${matrix.yaw}"}}
"""


def loaded(folder: Path, text: str) -> tuple[list[Spec], list[Diagnostic]]:
    path = folder / "example.dodo.yml"
    path.write_text(examples.with_keys_of(examples.EXAMPLE, text))
    return load_spec(Location(path, folder))


def values(spec: Spec) -> tuple[str, str, float | None]:
    pose = next(use for use in spec.uses if use.name == "pose").parameters
    start, yaw = pose["x"].value, pose["yaw"].value
    assert isinstance(start, Scalar)
    assert isinstance(yaw, Scalar)
    return start.text, yaw.text, spec.timeout_s


def test_a_plain_run_takes_the_nominal_values(tmp_path: Path) -> None:
    specs, problems = loaded(tmp_path, TEXT)
    assert problems == []
    assert [spec.slug for spec in specs] == ["example--yaw-80-deg", "example--yaw-90-deg"]
    assert [values(spec) for spec in specs] == [("0 cm", "80 deg", 90.0), ("0 cm", "90 deg", 90.0)]


def test_corners_have_each_end_once(tmp_path: Path) -> None:
    (first, _), _ = loaded(tmp_path, TEXT)
    assert [values(corner) for corner in first.corners] == [
        ("-8 cm", "80 deg", 60.0),
        ("8 cm", "80 deg", 90.0),
        ("0 cm", "80 deg", 120.0),
    ]
    assert first.corners[0].title == "example[yaw=80 deg,start=-8 cm,limit=60 s]"


def test_a_test_that_extends_another_changes_its_ranges(tmp_path: Path) -> None:
    loaded(tmp_path, TEXT)
    path = tmp_path / "own.dodo.yml"
    path.write_text(
        "dodo: 1\nname: own\nextends: example.dodo.yml\nmatrix:\nvary: {start: {nominal: 2 cm}}\n"
        "action: {pose: {with: {yaw: 70 deg}}}\n"
    )
    (spec,), problems = load_spec(Location(path, tmp_path))
    assert problems == []
    assert values(spec) == ("2 cm", "70 deg", 90.0)
    assert [one.text for one in spec.ranges] == ["-8 cm to 8 cm", "60 s, 90 s, 2 min"]


def test_no_more_instances_are_read_after_twenty_with_mistakes(tmp_path: Path) -> None:
    """A long text is checked for each: a spec of 1 MB with 1,000 instances took minutes."""
    folder = tmp_path / "a"
    folder.mkdir()
    values = ", ".join(f"v{number}" for number in range(50))
    text = f'dodo: 1\nname: a\nmatrix: {{a: [{values}]}}\ndescription: "${{matrix.a}} {"x " * 5000}"\n'
    (folder / "a.dodo.yml").write_text(text)
    specs, problems = load_spec(Location(folder / "a.dodo.yml", tmp_path))
    assert len(specs) == 20
    sizes = {d.message for d in problems if d.span.line == 4}
    assert sizes == {f"'description' has {n} characters, expected at most 2000" for n in (10_003, 10_004)}
