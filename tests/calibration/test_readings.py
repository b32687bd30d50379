from pathlib import Path

import pytest

from dodo_dsl.run.rigs.axis_calibration import AXES, Reading, ReadingsError, as_text, of_file, of_flag, place


def test_places_have_units() -> None:
    assert place(AXES["x"], "-41.2 cm") == -0.412 and place(AXES["yaw"], "1 rad") == pytest.approx(57.29577951)
    with pytest.raises(ReadingsError, match=r"'412' has no unit, expected a length in m; write for example '412 m'"):
        place(AXES["x"], "412")


def test_flags() -> None:
    assert of_flag("x:532.1:-740mm") == ("x", Reading(532.1, -0.74))
    assert of_flag("yaw:17.5 steps:-118.2 deg") == ("yaw", Reading(17.5, -118.2))


@pytest.mark.parametrize("text", ["x", "z:1:1mm", "x:1", "x:one:1 mm", "x:1:1", "x:1:1 deg", "x:1:2:3"])
def test_flags_that_are_wrong(text: str) -> None:
    with pytest.raises(ReadingsError, match=text):
        of_flag(text)


def test_a_file_is_read_as_it_is_written(tmp_path: Path) -> None:
    found = {"x": [Reading(532.1, -0.74), Reading(1000.0, 0.1)], "yaw": [Reading(17.5, -118.2)]}
    (tmp_path / "r.yml").write_text(as_text(found))
    assert of_file(tmp_path / "r.yml") == found


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("z: []", "r.yml:1:1: 'z': expected lists of readings by axis"),
        ("x: 1", "r.yml:1:1: 'x': expected lists"),
        ("- 1", "r.yml: expected lists"),
        ("", "r.yml: expected lists"),
        ("x:\n  - 4 mm", "r.yml:2:5: expected a reading such as"),
        ("x:\n  - {steps: 1 steps, read: 4 mm}", "r.yml:2:5: expected a reading such as"),
        ("x:\n  - {steps: 1, reads: 4 mm}", "r.yml:2:13: '1' has no unit, expected a step count in steps"),
        ("x: [{steps: 1 steps, reads: 4 deg}]", "r.yml:1:29: '4 deg' is an angle, expected a length in m"),
        ("x: [{steps: [], reads: 4 deg}]", "r.yml:1:13: expected a quantity in steps"),
        ("x: [", "r.yml:"),
    ],
)
def test_a_file_that_is_wrong(text: str, said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("r.yml").write_text(text)
    with pytest.raises(ReadingsError) as error:
        of_file(Path("r.yml"))
    assert str(error.value).startswith(said)
