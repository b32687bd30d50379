"""A bag of ROS 2 (rosbag2, in MCAP or SQLite), as rosbags reads and writes it, and the topics of recordings in it."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

from dodo_dsl.opendlv import ros_fields as ros
from dodo_dsl.opendlv.ros_codec import RosTypeError, require_ros
from dodo_dsl.opendlv.ros_types import GIVEN, MEMORY, MOTION_REQUEST, POSE_ESTIMATE, SENT

STORAGES = {"mcap": "MCAP", "sqlite3": "SQLITE3"}

READ = {type_: ways[0] for type_, ways in GIVEN.items() if ways[0] != (MEMORY,)} | {
    type_: bus for type_, bus in SENT.items() if type_ != ros.ODOMETRY_TYPE
}
"""The messages that each type of a bag becomes: a TwistStamped is a request, an Odometry a reading."""


class Way(NamedTuple):
    """The ROS type and topic of messages; all of them, or any where the type can say what is not there."""

    type: str
    messages: tuple[str, ...]
    topic: str
    is_any: bool = False


WRITTEN = (
    Way("geometry_msgs/msg/Twist", (MOTION_REQUEST,), "/cmd_vel"),
    Way("ackermann_msgs/msg/AckermannDriveStamped", (ros.STEERING, ros.SPEED), "/drive"),
    Way(ros.LASER_SCAN, (ros.SCAN,), "/scan"),
    Way(ros.RANGE, (ros.DISTANCE,), "/range"),
    Way(ros.IMU, (ros.ANGULAR, ros.ACCELERATION), "/imu", is_any=True),
    Way(ros.NAV_SAT_FIX, (ros.GEOLOCATION,), "/fix"),
    Way(ros.NAV_SAT_FIX, (ros.WGS84,), "/fix_without_altitude"),
    Way(ros.ODOMETRY_TYPE, (ros.ODOMETRY,), "/odom"),
    Way(ros.TWIST_STAMPED, (ros.GROUND_SPEED,), "/speed"),
    Way("geometry_msgs/msg/PoseStamped", (POSE_ESTIMATE,), "/pose"),
    Way(ros.DETECTIONS, SENT[ros.DETECTIONS], "/detections", is_any=True),
)
"""The topics of a recording; a sender stamp that is not the first one follows the name."""


class BagError(RosTypeError):
    """A bag that cannot be read or has nothing for a recording, or a recording with nothing for a bag; one sentence."""


class Stored(NamedTuple):
    """A message of a bag: its topic and type, when it was stored in us, and its bytes."""

    topic: str
    type: str
    time: int
    data: bytes


class Bag:
    """An open bag: ``counts`` are the messages of each topic and type, by their names."""

    def __init__(self, reader: Any, path: Path) -> None:
        self._reader, self.path = reader, path
        self.counts: dict[tuple[str, str], int] = {}
        for each in sorted(reader.connections, key=lambda found: (found.topic, found.msgtype)):
            key = each.topic, each.msgtype
            self.counts[key] = self.counts.get(key, 0) + each.msgcount

    def messages(self, wanted: Callable[[str, str], bool]) -> Iterator[Stored]:
        """The messages of topics and types that are wanted, in the bag's order; raises BagError."""
        chosen = [each for each in self._reader.connections if wanted(each.topic, each.msgtype)]
        found = self._reader.messages(connections=chosen) if chosen else iter(())
        while True:
            with _readable(self.path):
                stored = next(found, None)
            if stored is None:
                return
            connection, time, data = stored
            yield Stored(connection.topic, connection.msgtype, time // 1000, data)


@contextmanager
def opened(path: Path) -> Iterator[Bag]:
    """A bag, which is a folder with ``metadata.yaml`` or one file, ``.mcap`` or ``.db3``; raises BagError, OSError."""
    require_ros("rosbags")
    from rosbags.rosbag2 import Reader

    path.stat()
    if path.is_dir() and not (path / "metadata.yaml").is_file():
        raise BagError(
            f"'{path}' is not a bag: it has no metadata.yaml; expected a folder of rosbag2, a .mcap or a .db3"
        )
    with _readable(path):
        reader = Reader(path)
        reader.open()
    try:
        with _readable(path):
            bag = Bag(reader, path)
        yield bag
    finally:
        reader.close()


@contextmanager
def _readable(path: Path) -> Iterator[None]:
    """What a damaged bag raises, in rosbags and the libraries below it, as BagError."""
    try:
        yield
    except (BagError, OSError):
        raise
    except Exception as error:  # noqa: BLE001
        reason = " ".join(str(error).split()) or type(error).__name__
        raise BagError(f"'{path}' cannot be read as a bag: {reason:.200}") from None


class BagWriter:
    """Writes a bag into a new folder; topics are made when their first message comes."""

    def __init__(self, writer: Any, store: Any) -> None:
        self._writer, self._store = writer, store
        self._connections: dict[str, Any] = {}
        self.counts: dict[tuple[str, str], int] = {}

    def write(self, topic: str, type_: str, time: int, data: bytes) -> None:
        """A message, stored at ``time`` us since the epoch."""
        if topic not in self._connections:
            self._connections[topic] = self._writer.add_connection(topic, type_, typestore=self._store)
        self._writer.write(self._connections[topic], time * 1000, data)
        self.counts[topic, type_] = self.counts.get((topic, type_), 0) + 1


@contextmanager
def written(folder: Path, name: str, storage: str, store: Any) -> Iterator[BagWriter]:
    """The files of a new bag go to an empty folder, named after the bag."""
    from rosbags.rosbag2 import StoragePlugin, Writer

    inner = folder / name
    with Writer(inner, version=9, storage_plugin=StoragePlugin[STORAGES[storage]]) as writer:
        yield BagWriter(writer, store)
    for file in inner.iterdir():
        file.rename(folder / file.name)
    inner.rmdir()
