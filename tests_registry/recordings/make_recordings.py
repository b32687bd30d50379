"""Makes the recordings beside this file: python tests_registry/recordings/make_recordings.py [FOLDER].

They are simulated drives with what a real camera adds: a lens that bends, a shutter that blurs what moves, and noise,
before a background that is not empty. The frames go through DoDo's own camera, vehicle, integrator and recorder,
without a bus and by their own time, so that the same bytes come out again (with the same libx264; another one
may choose other bits for the same frames).

``kiwi-track.rec`` is a drive on the map ``kiwi-track``: from the start through the first corners, by a driver who
knows the track. Beside the camera's frames it holds Frame, KinematicState, and the driver's requests for steering
and pedal, under the sender stamp 0 as applications send theirs. ``static-rig.rec`` is the board of the static rig, from
where its camera stands, in ordinary light, in bright light, and in the dusk.
"""

import importlib.util
import math
import sys
from collections.abc import Iterable, Iterator
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parents[1]))  # the services of this checkout

from dodo_dsl.opendlv import pixels  # noqa: E402
from dodo_dsl.opendlv.attitude import quaternion  # noqa: E402
from dodo_dsl.opendlv.envelope import Envelope  # noqa: E402
from dodo_dsl.opendlv.message_set import MessageSet  # noqa: E402
from dodo_dsl.opendlv.video import FORMAT, VideoEncoder  # noqa: E402
from services.dynamic_model.model import Vehicle  # noqa: E402
from services.integrator.model import (  # noqa: E402
    BodyPose,
    Integrator,
    Twist,
)
from services.rec_recorder.model import RecordingFile  # noqa: E402
from services.scene.camera import Pinhole, mount  # noqa: E402
from services.scene.lens import Distortion, Lens  # noqa: E402
from services.scene.render import Renderer  # noqa: E402
from services.scene.scene import SceneOptions, load_scene  # noqa: E402
from services.virtual_camera.model import VirtualCamera  # noqa: E402
from services.virtual_camera.optics import Optics, Sensor  # noqa: E402

BEGIN = 1_700_000_000_000_000  # us since the epoch
SIZE, FOVY, ABOVE = (640, 480), math.radians(48.8), 0.095
CAMERA_HZ, VEHICLE_HZ = 10, 100
LENS = Distortion(-0.04, 0.01)
SHUTTER = 0.01  # s
CLUTTER, SEED = 12, 7
QUALITY, KEY_INTERVAL = 28, 20
PEDAL = 0.08  # 0.52 m/s
DRIVE_S = 15.0


@dataclass(frozen=True)
class Condition:
    """So many seconds of light on the sensor, and the noise that is in it."""

    length: float
    exposure: float
    noise: float


ORDINARY = Condition(2.0, 1.0, 0.01)
RIG = (ORDINARY, Condition(2.0, 1.5, 0.006), Condition(2.0, 0.55, 0.02))


def program(name: str) -> Any:
    """A script of the registry, as a module."""
    path = HERE.parent / name
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


class Recorded:
    """A recording under way; sent and received when it was sampled, so that nothing shows when it was made."""

    def __init__(self, recording: RecordingFile) -> None:
        self.messages = MessageSet.standard()
        self._recording = recording
        self._encoder = VideoEncoder("i420", *SIZE, KEY_INTERVAL, QUALITY)
        self._pictures = 0

    def say(self, now: int, name: str, sender_stamp: int = 0, **fields: float | int | str | bytes) -> None:
        """Record a message sampled at ``now`` us."""
        payload = self.messages.encode(self.messages.type(name)(**fields))
        self._recording.write(Envelope(self.messages.id(name), payload, now, now, now, sender_stamp))

    def show(self, i420: Any, now: int) -> None:
        """Record a frame."""
        width, height = SIZE
        data = self._encoder.encode(pixels.view(i420.tobytes(), "i420", width, height))
        fields = {"format": FORMAT, "width": width, "height": height, "data": data, "sampleId": self._pictures}
        self.say(now, "opendlv.proxy.ImageReading", **fields)
        self._pictures += 1


def camera(recorded: Recorded, map_name: str, condition: Condition) -> VirtualCamera:
    """The camera in front of the car, which records what it sees."""
    scene = load_scene(HERE.parent / "maps" / map_name, SceneOptions(clutter=CLUTTER, seed=SEED))
    ideal = Pinhole(*SIZE, FOVY)
    optics = Optics(ideal, Lens(ideal, LENS), Sensor(condition.exposure, 1.0, condition.noise, SEED), (), SHUTTER)
    renderer = Renderer(scene, optics.wide.width, optics.wide.height, optics.wide.fovy)
    mounted = mount(0.0, 0.0, ABOVE, 0.0, 0.0, 0.0)
    return VirtualCamera(renderer, mounted, lambda _argb, i420, now: recorded.show(i420, now), optics)


def frame(pose: BodyPose) -> dict[str, float]:
    """The fields of opendlv.sim.Frame."""
    return dict(zip(("x", "y", "z", "qx", "qy", "qz", "qw"), (*pose.position, *pose.attitude), strict=True))


class Driver:
    """Knows the track: steers towards its middle ahead."""

    def __init__(self, track: str) -> None:
        self._targets = program("targets/make_targets.py")
        self._track, self._along = track, self._targets.MAPS.LEAD

    def request(self, pose: BodyPose) -> float:
        """The steering request in rad from where the car is."""
        x, y, _ = pose.position
        near = (self._along + step * 0.005 for step in range(60))
        self._along = min(near, key=lambda along: math.dist((x, y), self._centre(along)[:2]))
        yaw = 2 * math.atan2(pose.attitude[2], pose.attitude[3])
        request: float = self._targets.steering((x, y, yaw), self._centre(self._along + self._targets.LOOK))
        return request

    def _centre(self, along: float) -> tuple[float, float, float]:
        place: tuple[float, float, float] = self._targets.centre(self._track, along)
        return place


def drive(recorded: Recorded) -> None:
    """The car on the Kiwi track; the driver looks with each frame."""
    vehicle, driver = Vehicle(), Driver("kiwi-track")
    body = Integrator(BodyPose((0.0, 0.0, 0.0), quaternion(0.0, 0.0, math.pi / 2)))
    eye = camera(recorded, "kiwi-track", ORDINARY)
    for now, is_picture in ticks(DRIVE_S):
        motion = vehicle.update(now)
        body.feed(Twist((motion.vx, motion.vy, 0.0), (0.0, 0.0, motion.yaw_rate)), now)
        pose = body.update(now)
        eye.take_frame(recorded.messages.type("opendlv.sim.Frame")(**frame(pose)), now)
        if is_picture:
            steering = driver.request(pose)
            vehicle.steer(steering)
            vehicle.press(PEDAL)
            state = {"vx": motion.vx, "vy": motion.vy, "yawRate": motion.yaw_rate}
            recorded.say(now, "opendlv.sim.KinematicState", **state)
            recorded.say(now, "opendlv.sim.Frame", **frame(pose))
            eye.update(now)
            recorded.say(now, "opendlv.proxy.GroundSteeringRequest", groundSteering=steering)
            recorded.say(now, "opendlv.proxy.PedalPositionRequest", position=PEDAL)


def ticks(length: float) -> Iterator[tuple[int, bool]]:
    """Test times in us at the vehicle's rate, and whether a frame is due."""
    for tick in range(round(length * VEHICLE_HZ) + 1):
        yield BEGIN + tick * 1_000_000 // VEHICLE_HZ, tick % (VEHICLE_HZ // CAMERA_HZ) == 0


def look(recorded: Recorded) -> None:
    """The board of the static rig, in each condition."""
    pose = BodyPose((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))
    now = BEGIN
    for condition in RIG:
        eye = camera(recorded, "static-rig", condition)
        eye.take_frame(recorded.messages.type("opendlv.sim.Frame")(**frame(pose)), now)
        for _ in range(round(condition.length * CAMERA_HZ)):
            eye.update(now)
            now += 1_000_000 // CAMERA_HZ


RECORDINGS = {"kiwi-track": drive, "static-rig": look}


def make(folder: Path, names: Iterable[str] = RECORDINGS) -> None:
    """Writes recordings; one that is there is replaced."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in names:
        play = RECORDINGS[name]
        path = folder / f"{name}.rec"
        part = path.with_suffix(".part")
        part.unlink(missing_ok=True)
        with closing(RecordingFile(part)) as recording:
            play(Recorded(recording))
        part.replace(path)


if __name__ == "__main__":
    make(Path(sys.argv[1]) if len(sys.argv) > 1 else HERE)
