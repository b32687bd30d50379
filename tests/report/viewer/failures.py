"""One drive for each way to fail, with the moment at which its page has to open."""

import math
from collections.abc import Iterator

import numpy as np

from dodo_dsl.opendlv.video import VideoEncoder
from tests.report.viewer.drives import MadeDrive, Pose, Sample, check, poses, requests, verdict

Box = tuple[str, float, float]
"""Class, left and top of a box of a tenth by a fifth of the picture."""


def into_the_wall(time: float) -> Pose:
    return -0.01165 * time**2.2, 0.5 * time, math.pi / 2 + 0.04 * time


def wall_hit() -> MadeDrive:
    time, reason = 3.21, "hit wall left after 3.21 s at x = -0.15 m, y = 1.61 m"
    x, y, _ = into_the_wall(time)
    checks = (check("time-to-goal", None, False, "s", max=40), check("wall-margin", 0.0, False, "m", min=0))
    samples = [*poses(into_the_wall, time), *requests(lambda t: 0.02 * t, time)]
    said = verdict("track", reason, time=time, x=x, y=y, obstacle="left")
    return MadeDrive(
        "sil-closed-straight", time, samples, {"reason": reason, "checks": checks, "verdicts": (said,)},
        {"application.steering": [(t / 10, f"frame {t}: steering {0.002 * t:.3f} rad") for t in range(33)]},
    )  # fmt: skip


def timed_out() -> MadeDrive:
    time, reason = 40.0, "did not reach finish within 40.00 s: the vehicle is at x = 0.00 m, y = 0.40 m, 2.42 m from it"
    samples = [*poses(lambda t: (0.0, min(0.1 * t, 0.4), math.pi / 2), time), *requests(lambda t: 0.0, time)]
    said = verdict("track", reason, time=time, x=0.0, y=0.4)
    clear = {**check("wall-margin", 0.17, True, "m", min=0), "exclusive": True}
    checks = (check("time-to-goal", None, False, "s", max=40), clear)
    return MadeDrive("sil-closed-straight", time, samples, {"reason": reason, "checks": checks, "verdicts": (said,)})


def wrong_signal() -> MadeDrive:
    time = 2.4
    reason = "groundSteering of opendlv.proxy.GroundSteeringRequest/0 was 0.2 with a target of 0.02 at 2.40 s"

    def steering(t: float) -> float:
        return 0.2 if abs(t - time) < 0.05 else -0.045 + 0.0245 * t

    said = verdict("signal", reason, time=time, value=0.2, target=0.02, gap_begin=0.0, gap_end=0.1)
    samples = [*poses(lambda t: (-0.1 + 0.04 * t, 0.5 * t, 1.5), 5.5), *requests(steering, 5.5)]
    checks = (check("mean", 0.009, True, max=0.014), check("distance", 0.18, False, max=0.06))
    outcome = {"reason": reason, "kind": "open-loop", "checks": checks, "verdicts": (said,)}
    return MadeDrive("sil-open-straight", 5.5, samples, outcome)


def crash() -> MadeDrive:
    reason = "application service 'steering' ended with exit code 1 after 2.3 s, before the test was decided"
    samples = [*poses(lambda t: (0.0, 0.5 * t, math.pi / 2), 2.3), *requests(lambda t: 0.0, 2.25)]
    lines = [(t / 10, f"frame {t}: steering 0.000 rad") for t in range(23)]
    trace = ["Traceback (most recent call last):", '  File "steering.py", line 12, in <module>', "KeyError: 'blue'"]
    outcome = {"reason": reason, "last_lines": tuple(trace)}
    return MadeDrive(
        "sil-closed-straight", 2.3, samples, outcome, {"application.steering": [*lines, *((2.3, t) for t in trace)]}
    )


def boxes(time: float, sender: int, found: list[Box]) -> Iterator[Sample]:
    for number, (label, x, y) in enumerate(found):
        known = {"sampleId": round(time * 10), "detectionId": number}
        logic = "opendlv.logic.perception.Detection"
        yield time, f"{logic}Property", sender, {**known, "property": f"color: {label}"}
        yield time, f"{logic}BoundingBox", sender, {**known, "x": x, "y": y, "width": 0.1, "height": 0.2}


def pictures(duration: float) -> Iterator[Sample]:
    """A frame each 100 ms whose brightness is its number."""
    encoder = VideoEncoder("bgr", 160, 120)
    for number in range(round(duration * 10) + 1):
        data = encoder.encode(np.full((120, 160, 3), 10 * number, np.uint8))
        fields = {"format": "h264", "width": 160, "height": 120, "data": data}
        yield number / 10, "opendlv.proxy.ImageReading", 0, fields


def missed_cones() -> MadeDrive:
    """From 0.7 s on one of two is missed, and there is a false one then; the last frame has no picture."""
    time, reason = 0.7, "found 23 of 32 objects in 16 frames, with 1 false detection: recall 0.71 (at least 0.9)"
    samples = [*pictures(1.4)]
    for number in range(16):
        at = number / 10
        samples += boxes(at, 9, [("yellow", 0.2, 0.5), ("blue", 0.7, 0.5)])
        wrong = [("blue", 0.45, 0.2)] if at == time else []
        samples += boxes(at, 0, [("yellow", 0.21, 0.5), *wrong, *([("blue", 0.7, 0.5)] if number < 7 else [])])
    said = verdict("cones", reason, time=time, found=1, false=1, missed=1, gap_begin=0.0, gap_end=0.1)
    checks = (check("recall", 0.71, False, min=0.9), check("precision", 0.96, True, min=0.7))
    outcome = {"reason": reason, "kind": "perception", "checks": checks, "verdicts": (said,)}
    return MadeDrive("sil-perception--light-0-45--clutter-0", 1.5, samples, outcome)


def set_up_failed() -> MadeDrive:
    reason = "service 'camera' of layer environment ended with exit code 2 during set-up"
    lines = [(0.0, "virtual-camera: CRITICAL: the map has no model 'cone_green'")]
    outcome = {"reason": reason, "outcome": "error", "last_lines": (lines[0][1],)}
    return MadeDrive("sil-closed-straight", 0.0, [], outcome, {"environment.camera": lines})


def false_detections() -> MadeDrive:
    """Three of the detections at 1.2 s are of nothing; no picture was recorded."""
    time, reason = 1.2, "precision is 0.91 (at least 0.95), with 3 false detections beside 32 found"
    samples = [sample for number in range(16) for sample in boxes(number / 10, 9, [("yellow", 0.2, 0.5)])]
    for number in range(16):
        wrong = [("yellow", n / 5, 0.1) for n in range(3)] if number / 10 == time else []
        samples += boxes(number / 10, 0, [("yellow", 0.2, 0.5), *wrong])
    said = verdict("cones", reason, time=time, found=1, false=3, missed=0)
    checks = (check("precision", 0.91, False, min=0.95),)
    outcome = {"reason": reason, "kind": "perception", "checks": checks, "verdicts": (said,)}
    return MadeDrive("sil-perception--light-0-45--clutter-0", 1.5, samples, outcome)


def rig_refused() -> MadeDrive:
    reason = "rig 'emulated' is in quarantine: its pictures do not change; dodo rig clear emulated"
    return MadeDrive("hil-dynamic", 0.0, [], {"reason": reason, "outcome": "error", "level": "hil"})
