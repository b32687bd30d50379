"""The example application in a closed loop with the camera, the car and the evaluator: test time only, no sockets."""

import importlib.util
import math
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from dodo_dsl.opendlv.assets.track import Track, VehicleBox, VehiclePose, load_obstacles, pick
from dodo_dsl.opendlv.attitude import quaternion
from services.base import Verdict
from services.collision.model import TrackEvaluator
from services.dynamic_model.model import Vehicle
from services.integrator.model import BodyPose as Attitude
from services.integrator.model import Integrator, Twist
from services.scene.camera import CameraPose
from services.scene.render import Renderer
from services.scene.scene import load_scene

ROOT = Path(__file__).parents[2]
MAPS = ROOT / "tests_registry" / "maps"
FRAME, STEP = 100_000, 10_000  # us: camera at 10 Hz, action layer at 100 Hz
STARTS = [(-0.05, -8.0), (-0.05, 8.0), (0.05, -8.0), (0.05, 8.0)]
"""m to the right, deg to the left; from the middle the tests of the registry drive."""
PROOF = pytest.mark.proof
FAR = [("straight", -0.05, -8.0), ("left-curve", 0.05, -8.0)]
"""Starts from which it leaves for the nearer wall; the others are for ``make proof``."""
OTHERS = [(name, *start) for name in ("straight", "left-curve") for start in STARTS if (name, *start) not in FAR]


def program(name: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(name, ROOT / "examples" / "kiwi" / f"{name}.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


perception, steering = program("perception"), program("steering")


@cache
def renderer(name: str) -> Renderer:
    return Renderer(load_scene(MAPS / name), 640, 480, math.radians(48.8))


@dataclass
class Loop:
    """One drive; `delay` is how long the application takes for a frame (us, a multiple of STEP)."""

    map: str
    right: float = 0.0
    yaw: float = 0.0
    reverse: bool = False
    delay: int = 0

    def run(self) -> Verdict:
        obstacles = load_obstacles(MAPS / self.map)
        walls = pick(obstacles, ["left", "right"], "walls", MAPS)
        evaluator = TrackEvaluator(
            Track(walls, pick(obstacles, ["finish"], "goal", MAPS), 40.0), VehicleBox(0.36, 0.16)
        )
        heading = math.radians(90 + self.yaw)
        car, body = Vehicle(), Integrator(Attitude((self.right, 0.0, 0.0), quaternion(0, 0, heading)))
        driver, answers = steering.Driver(self.reverse), []
        now = 0
        evaluator.begin(now)
        while evaluator.verdict is None:
            for due, (angle, pedal) in answers:
                if due == now:
                    car.steer(angle)
                    car.press(pedal)
            motion = car.update(now)
            body.feed(Twist((motion.vx, motion.vy, 0.0), (0.0, 0.0, motion.yaw_rate)), now)
            pose = plane(body.update(now))
            evaluator.look(pose, now)
            evaluator.update(now)
            if now % FRAME == 0:
                answers.append((now + self.delay + STEP, self.answer(driver, pose)))
                for name in ("GroundSteeringRequest", "PedalPositionRequest"):
                    evaluator.request(name)
            now += STEP
        return evaluator.verdict

    def answer(self, driver: Any, pose: VehiclePose) -> tuple[float, float]:
        eye = CameraPose.at(pose.x, pose.y, 0.095, 0.0, 0.0, pose.heading)
        places: dict[str, list[Any]] = {"yellow": [], "blue": []}
        for cone in perception.find(renderer(self.map).render(eye)):
            place = steering.on_the_ground(cone.x, cone.y, cone.width, cone.height)
            if place is not None:
                places[cone.colour].append(place)
        result: tuple[float, float] = driver.drive(places["yellow"], places["blue"])
        return result


def plane(pose: Attitude) -> VehiclePose:
    x, y, _ = pose.position
    return VehiclePose(x, y, 2 * math.atan2(pose.attitude[2], pose.attitude[3]))


def margin(verdict: Verdict) -> float:
    value = {check.name: check.value for check in verdict.checks}["wall-margin"]
    assert value is not None
    return value


@pytest.mark.slow
@pytest.mark.parametrize(("name", "right", "yaw"), [*FAR, *(pytest.param(*one, marks=PROOF) for one in OTHERS)])
def test_the_car_reaches_the_finish_with_room_to_spare(name: str, right: float, yaw: float) -> None:
    verdict = Loop(name, right, yaw).run()
    assert verdict.outcome == "passed", verdict.reason
    assert margin(verdict) > 0.02


@pytest.mark.slow
def test_the_car_drives_a_lap() -> None:
    verdict = Loop("kiwi-track", 0.05, -8.0).run()
    assert verdict.outcome == "passed", verdict.reason
    assert margin(verdict) > 0.06


@pytest.mark.slow
@pytest.mark.parametrize("name", ["left-curve", *(pytest.param(n, marks=PROOF) for n in ("straight", "kiwi-track"))])
def test_a_slow_application_still_reaches_it(name: str) -> None:
    verdict = Loop(name, 0.02, 4.0, delay=80_000).run()
    assert verdict.outcome == "passed", verdict.reason


@pytest.mark.parametrize(("right", "yaw"), [(0.02, 4.0), *(pytest.param(*start, marks=PROOF) for start in STARTS)])
@pytest.mark.thorough
def test_reversed_steering_hits_a_wall(right: float, yaw: float) -> None:
    verdict = Loop("straight", right, yaw, reverse=True).run()
    assert verdict.outcome == "failed"
    assert verdict.reason.startswith("hit wall ")
