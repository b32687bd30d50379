"""A bag of ROS 2 (rosbag2, in MCAP or SQLite), as rosbags reads and writes it, and the topics of recordings in it."""

from collections import Counter
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from dodo_dsl.opendlv import ros_types as ros
from dodo_dsl.opendlv.ros_codec import RosTypeError, require_ros

READ = {type_: ways[0] for type_, ways in ros.GIVEN.items() if ways[0] != (ros.MEMORY,)} | {
    type_: bus for type_, bus in ros.SENT.items() if type_ != ros.ODOMETRY
}
"""The messages that each type of a bag becomes: a TwistStamped is a request, an Odometry a reading."""

WRITTEN = {
    "/cmd_vel": (ros.TWIST, (ros.MOTION_REQUEST,)),
    "/drive": (ros.ACKERMANN_STAMPED, (ros.STEERING, ros.SPEED)),
    "/scan": (ros.LASER_SCAN, (ros.PLANAR_SCAN,)),
    "/range": (ros.RANGE, (ros.DISTANCE,)),
    "/imu": (ros.IMU, (ros.ANGULAR, ros.ACCELERATION)),
    "/fix": (ros.NAV_SAT_FIX, (ros.GEOLOCATION,)),
    "/odom": (ros.ODOMETRY, (ros.ODOMETRY_READING,)),
    "/speed": (ros.TWIST_STAMPED, (ros.GROUND_SPEED,)),
    "/pose": (ros.POSE_STAMPED, (ros.POSE_ESTIMATE,)),
    "/detections": (ros.DETECTIONS, ros.SENT[ros.DETECTIONS]),
}
"""The topics of a recording, each with its type and messages; a sender stamp that is not the first follows the name."""

Key = tuple[str, str]
"""Name and type of a topic."""


class BagError(RosTypeError):
    """A bag that cannot be read, or that has nothing for a recording; one sentence."""


class Bag:
    """An open bag: ``counts`` are the messages of each topic, by their names."""

    def __init__(self, reader: Any, path: Path) -> None:
        self._reader, self.path = reader, path
        self.counts = Counter[Key]()
        for topic, type_, count in sorted((each.topic, each.msgtype, each.msgcount) for each in reader.connections):
            self.counts[topic, type_] += count

    def messages(self, wanted: Collection[Key]) -> Iterator[tuple[Key, int, bytes]]:
        """The messages of topics in the bag's order, each with the time in us of its storage; raises BagError."""
        chosen = [each for each in self._reader.connections if (each.topic, each.msgtype) in wanted]
        with _readable(self.path):
            for connection, time, data in self._reader.messages(connections=chosen) if chosen else ():
                yield (connection.topic, connection.msgtype), time // 1000, data


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
        bag = Bag(reader, path)
    try:
        yield bag
    finally:
        reader.close()


@contextmanager
def _readable(path: Path) -> Iterator[None]:
    """What a damaged bag raises, in rosbags and the libraries below it, as BagError."""
    try:
        yield
    except OSError:
        raise
    except Exception as error:  # noqa: BLE001
        reason = " ".join(str(error).split()) or type(error).__name__
        raise BagError(f"'{path}' cannot be read as a bag: {reason:.200}") from None


@contextmanager
def written(folder: Path, name: str) -> Iterator[Any]:
    """The writer of a new bag; its files go to an empty folder, named after the bag."""
    from rosbags.rosbag2 import StoragePlugin, Writer

    inner = folder / name
    with Writer(inner, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        yield writer
    for file in inner.iterdir():
        file.rename(folder / file.name)
    inner.rmdir()
