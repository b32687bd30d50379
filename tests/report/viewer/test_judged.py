"""What evaluators recorded, as the page draws it."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dodo_dsl.report.trajectory import Way, ground_of
from dodo_dsl.report.viewer import page
from dodo_dsl.report.viewer import recorded as recorded_test
from dodo_dsl.report.viewer.judged import JudgedRecord, read
from dodo_dsl.report.viewer.units import title_of, unit_of
from services.base import Judged, JudgedBoxes
from services.base import judged as recording
from tests.report.viewer import drives, failures
from tests.report.viewer.drives import EPOCH, ROOT
from tests.report.viewer.drives import shipped as plan


def recorded(folder: Path, fill: Callable[[Judged], object], *more: str) -> JudgedRecord:
    """What the page gets of an evaluator's record, and of further lines in it."""
    record = Judged()
    fill(record)
    lines = [*record.lines({"largest-step": ("max-step",)}), *more]
    (folder / "evaluation.track.judged").write_text("\n".join(lines))
    assert max(map(len, lines)) < 60_000
    return read(plan("sil-closed-straight"), folder)


def test_a_series_with_its_limits_and_its_target(tmp_path: Path) -> None:
    def fill(record: Judged) -> None:
        series = record.series("Step", "deg", high=3, distance=0.5, band=0.1)
        for number, value in enumerate((1.0, 1.2, 2.0, 4.0, float("nan"))):
            series.add(EPOCH + number * 500_000, value, target=1.0)

    found = recorded(tmp_path, fill)
    (series,) = found.series(EPOCH)
    assert (series["name"], series["unit"], series["high"]) == ("Step", "deg", 3)
    assert series["note"] == "band ±0.1, at most 3 deg, distance at most 0.5 deg"
    assert drives.unpacked(series["times"]).tolist() == [0.0, 0.5, 1.0, 1.5, 2.0]
    assert drives.unpacked(series["values"]).tolist()[:4] == np.float32([1, 1.2, 2, 4]).tolist()
    assert series["marks"] == "AAECAgI="  # 0 1 2 2 2
    assert drives.unpacked(series["target"]["values"]).tolist() == [1.0] * 5
    assert found.parameters == {"track": {"largest-step": ("max-step",)}}
    assert (found.silent, found.why()) == ([], "")


def test_what_failed_is_among_the_samples_that_are_kept(tmp_path: Path) -> None:
    count = 3 * recording.MOST_SAMPLES

    def fill(record: Judged) -> None:
        series = record.series("Distance", low=0, exclusive=True)
        for number in range(count):
            series.add(EPOCH + number * 1000, 0.0 if number == 41_001 else 1.0 + number % 7)

    (series,) = recorded(tmp_path, fill).series(EPOCH)
    times, values = drives.unpacked(series["times"]), drives.unpacked(series["values"])
    assert recording.MOST_SAMPLES / 4 < len(times) <= recording.MOST_SAMPLES
    assert (values.min(), values.max(), times[values == 0].tolist()) == (0, 7, [np.float32(41.001)])
    assert (np.diff(times) > 0).all()


def test_boxes_of_frames(tmp_path: Path) -> None:
    many = [(str(n) + 50 * "\N{AUTOMOBILE}", 0.1, 0.2, 0.3, 0.4) for n in range(400)]

    def fill(record: Judged) -> None:
        record.frame(EPOCH + 200_000, JudgedBoxes([("a", 0.1, 0.2, 0.3, 0.4, 0.51234)], [], many))
        record.frame(EPOCH + 100_000, JudgedBoxes([], [("far", 1e6, 0, 1, 1)], [], is_known=False))

    unknown, frame = recorded(tmp_path, fill).frames(EPOCH)
    assert unknown == {"time": 0.1, "isKnown": False, "hit": [], "false": [], "missed": []}
    assert (frame["time"], frame["isKnown"], frame["false"]) == (0.2, True, [])
    assert frame["hit"] == [["a", 0.1, 0.2, 0.3, 0.4, 0.5123]]
    assert [label for label, *_ in frame["missed"]] == [label for label, *_ in many]


def test_lines_that_are_none_cost_only_themselves(tmp_path: Path) -> None:
    wrong = [{"samples": "gone"}, {"series": 7, "low": "x"}, {"way": []}, {"frames": [1]}, {"parameters": 3}, {}]
    wrong += [{"frames": [[1 << 70, True, []]]}, {"frames": [[EPOCH, True, [["false", "a", 0, 0, 1, float("inf")]]]]}]
    part = {"samples": "Step", "zero": EPOCH, "times": "AAAA", "values": "AAAA", "marks": ""}
    lines = [*(json.dumps({"dodo": "judged", **each}) for each in (*wrong, part)), "[", "[]", "7"]
    found = recorded(tmp_path, lambda record: record.series("Step").add(EPOCH, 1.0), *lines)
    assert [each["name"] for each in found.series(EPOCH)] == ["Step"]
    assert [frame["false"] for frame in found.frames(EPOCH)] == [[]]


def test_an_evaluator_without_a_record_is_named(tmp_path: Path) -> None:
    why = "'track' recorded no time series, so no limits and targets are plotted."
    assert read(plan("sil-closed-straight"), tmp_path).why() == why


def test_lines_of_the_map_have_roles(tmp_path: Path) -> None:
    (tmp_path / "files").symlink_to(ROOT / "tests_registry")
    whole = plan(failures.wall_hit().slug)
    drives.judge(tmp_path, whole, tmp_path, failures.wall_hit())
    way = read(whole, tmp_path).way
    assert way is not None
    shown = page.scene(ground_of(whole, tmp_path), way)
    assert {line["name"]: line["role"] for line in shown["lines"]} == {
        "left": "wall",
        "right": "wall",
        "behind": "wall",
        "beyond": "wall",
        "finish": "goal",
    }
    assert (shown["length"], shown["width"], shown["frame"]["sender"]) == (0.36, 0.16, 0)
    other = replace(way, roles={})
    assert {line["role"] for line in page.scene(ground_of(whole, tmp_path), other)["lines"]} == {"other"}


def test_other_vehicles_are_known_by_their_stamps(tmp_path: Path) -> None:
    """But for the own one; their outlines have x ahead."""
    (tmp_path / "files").symlink_to(ROOT / "tests_registry")
    whole = plan("sil-closed-two-cars")
    (body,) = page.scene(ground_of(whole, tmp_path), Way(frame=0))["bodies"]
    assert (body["name"], body["sender"], body["colour"]) == ("kiwi", 1, [0.75, 0.1, 0.6])
    xs, ys = zip(*body["outline"], strict=True)
    assert (min(xs), max(xs), min(ys), max(ys)) == pytest.approx((-0.18, 0.18, -0.08, 0.08))
    assert [each["sender"] for each in page.scene(ground_of(whole, tmp_path), Way(frame=1))["bodies"]] == [0]
    assert page.scene(ground_of(plan("sil-closed-straight"), tmp_path), Way())["bodies"] == []


def test_the_path_is_that_of_one_sender(tmp_path: Path) -> None:
    """Of the judged vehicle, or else of the first; another vehicle's frames lie between."""
    frames = [(n / 10, "opendlv.sim.Frame", 3 * (n % 2), {"x": float(n % 2), "qw": 1.0}) for n in range(6)]
    drives.record(tmp_path / "test.rec", drives.MadeDrive("sil-closed-two-cars", 1.0, frames, {}))
    test = recorded_test.read(tmp_path / "test.rec", drives.MESSAGES)
    for sender, x in ((3, 1.0), (0, 0.0), (7, 0.0)):
        assert page._path(test, sender)[:, 0].tolist() == [x] * 3


def test_units_are_those_of_fields_and_titles_are_short() -> None:
    signals = ("groundSteering of GroundSteeringRequest/2", "x of Frame/1", "x of Cone", "Distance to the walls")
    assert [unit_of(signal) for signal in signals] == ["rad", "m", "", ""]
    assert [title_of(signal) for signal in (*signals, "groundSteering of GroundSteeringRequest/0")] == [
        "Steering/2",
        *signals[1:],
        "Steering",
    ]
