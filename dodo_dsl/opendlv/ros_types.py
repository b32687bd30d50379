"""Which ROS 2 types are carried between the bus and an application's graph, and the topics of a test.

Plain data, without ROS and without what reads it, as the compiler loads it, too. Types are named as ROS does:
``package/msg/Name``. Units and frames of reference are those of REP 103 and REP 105.
"""

from collections.abc import Mapping

import msgspec

MEMORY = "memory"
"""What stands for a shared memory among the sources of a type."""

CLOCK, CLOCK_TYPE = "/clock", "rosgraph_msgs/msg/Clock"
STATIC_FRAMES, STATIC_FRAMES_TYPE = "/tf_static", "tf2_msgs/msg/TFMessage"
"""Topics that are always there."""

MOTION_REQUEST = "opendlv.proxy.GroundMotionRequest"
POSE_ESTIMATE = "robot.PoseEstimate"

GIVEN: Mapping[str, tuple[tuple[str, ...], ...]] = {
    "sensor_msgs/msg/Image": ((MEMORY,),),
    "sensor_msgs/msg/CompressedImage": ((MEMORY,),),
    "sensor_msgs/msg/CameraInfo": ((MEMORY,),),
    "sensor_msgs/msg/LaserScan": (("robot.PlanarScan",),),
    "sensor_msgs/msg/Range": (("opendlv.proxy.DistanceReading",),),
    "sensor_msgs/msg/Imu": (("opendlv.proxy.AngularVelocityReading", "opendlv.proxy.AccelerationReading"),),
    "sensor_msgs/msg/NavSatFix": (
        ("opendlv.logic.sensation.Geolocation",),
        ("opendlv.proxy.GeodeticWgs84PositionReading",),
    ),
    "nav_msgs/msg/Odometry": (("robot.OdometryReading",),),
    "geometry_msgs/msg/TwistStamped": (
        ("robot.OdometryReading",),
        ("opendlv.proxy.GroundSpeedReading", "opendlv.proxy.AngularVelocityReading"),
    ),
}
"""The types of ``in``: what each is made of, the first that the test has of several ways."""

SENT: Mapping[str, tuple[str, ...]] = {
    "geometry_msgs/msg/Twist": (MOTION_REQUEST,),
    "geometry_msgs/msg/TwistStamped": (MOTION_REQUEST,),
    "ackermann_msgs/msg/AckermannDrive": ("opendlv.proxy.GroundSteeringRequest", "opendlv.proxy.GroundSpeedRequest"),
    "ackermann_msgs/msg/AckermannDriveStamped": (
        "opendlv.proxy.GroundSteeringRequest",
        "opendlv.proxy.GroundSpeedRequest",
    ),
    "vision_msgs/msg/Detection2DArray": (
        "opendlv.logic.perception.DetectionBoundingBox",
        "opendlv.logic.perception.DetectionProperty",
        "opendlv.logic.perception.DetectionType",
    ),
    "nav_msgs/msg/Odometry": (POSE_ESTIMATE,),
    "geometry_msgs/msg/PoseStamped": (POSE_ESTIMATE,),
    "geometry_msgs/msg/PoseWithCovarianceStamped": (POSE_ESTIMATE,),
}
"""The types of ``out``: the messages that each becomes."""

NUMBERS = ("std_msgs/msg/Float32", "std_msgs/msg/Float64")
"""Types of one number: they need ``from`` or ``to``, a message with one number."""


FRAME_IDS: Mapping[str, str] = {
    "sensor_msgs/msg/Image": "camera_optical_frame",
    "sensor_msgs/msg/CompressedImage": "camera_optical_frame",
    "sensor_msgs/msg/CameraInfo": "camera_optical_frame",
    "sensor_msgs/msg/LaserScan": "laser",
    "sensor_msgs/msg/Range": "range",
    "sensor_msgs/msg/Imu": "imu",
    "sensor_msgs/msg/NavSatFix": "gps",
    "nav_msgs/msg/Odometry": "odom",
    "geometry_msgs/msg/TwistStamped": "base_link",
}
"""The frame of what a test gives, by type (REP 103 and 105)."""


NODE_ENVIRONMENT: Mapping[str, str] = {
    "FASTDDS_BUILTIN_TRANSPORTS": "UDPv4?max_msg_size=65500&sockets_size=16777216",
    "CYCLONEDDS_URI": (
        "<CycloneDDS><Domain><General><MaxMessageSize>65500B</MaxMessageSize><FragmentSize>65000B</FragmentSize>"
        "</General><Internal><SocketReceiveBufferSize max='16MB'/></Internal></Domain></CycloneDDS>"
    ),
}
"""Variables of an application's nodes where it does not set them: datagrams of 65 kB, and receive buffers that hold
some pictures, or what the kernel grants. Without shared memory, so that messages come in the same order each time."""


class CameraView(msgspec.Struct, frozen=True, kw_only=True):
    """A camera's picture in pixels, its vertical opening angle in degrees (0 if unknown), and its memory's format."""

    width: int
    height: int
    fovy: float = 0.0
    format: str = ""


class Topic(msgspec.Struct, frozen=True, kw_only=True, rename="kebab", omit_defaults=True):
    """A topic of one test, and what it is made of, or becomes, on the test's bus.

    ``bus`` are messages, each ``name`` or ``name/senderStamp``, or the name of a shared memory with its format. Empty
    words and 0 take the default of the type. ``fields`` gives fields of a message the paths of a ROS type's own.
    """

    topic: str
    type: str
    bus: tuple[str, ...]
    encoding: str = ""
    frame_id: str = ""
    reliability: str = ""
    durability: str = ""
    depth: int = 10
    rate: float = 0.0
    fields: dict[str, str] = {}
    camera: CameraView | None = None


class StaticFrame(msgspec.Struct, frozen=True, kw_only=True):
    """Where a sensor stands on the robot: x forward, y to the left, z up, in m and rad (REP 103)."""

    parent: str
    child: str
    x: float = 0.0
    y: float = 0.0
    z: float = 0.0
    roll: float = 0.0
    pitch: float = 0.0
    yaw: float = 0.0


class RosGraph(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True):
    """All topics between a test and its application: ``given`` to it and ``sent`` by it.

    ``services`` are those of the application that have each topic, by the topic's name. ``types`` are the texts of the
    team's own types, by the places of their files, such as ``lane_msgs/msg/Lane.msg``; ``messages`` is that of its own
    messages (ODVD).
    """

    given: tuple[Topic, ...] = ()
    sent: tuple[Topic, ...] = ()
    frames: tuple[StaticFrame, ...] = ()
    services: dict[str, tuple[str, ...]] = {}
    types: dict[str, str] = {}
    messages: str = ""
