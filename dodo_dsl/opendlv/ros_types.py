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

IMAGE, COMPRESSED, CAMERA_INFO = (f"sensor_msgs/msg/{name}" for name in ("Image", "CompressedImage", "CameraInfo"))
LASER_SCAN, RANGE, IMU, NAV_SAT_FIX = (f"sensor_msgs/msg/{name}" for name in ("LaserScan", "Range", "Imu", "NavSatFix"))
TWIST, TWIST_STAMPED = "geometry_msgs/msg/Twist", "geometry_msgs/msg/TwistStamped"
POSE_STAMPED, POSE_COVARIANCE = "geometry_msgs/msg/PoseStamped", "geometry_msgs/msg/PoseWithCovarianceStamped"
ACKERMANN, ACKERMANN_STAMPED = "ackermann_msgs/msg/AckermannDrive", "ackermann_msgs/msg/AckermannDriveStamped"
ODOMETRY, DETECTIONS = "nav_msgs/msg/Odometry", "vision_msgs/msg/Detection2DArray"

ANGULAR, ACCELERATION = "opendlv.proxy.AngularVelocityReading", "opendlv.proxy.AccelerationReading"
DISTANCE, GROUND_SPEED = "opendlv.proxy.DistanceReading", "opendlv.proxy.GroundSpeedReading"
GEOLOCATION, WGS84 = "opendlv.logic.sensation.Geolocation", "opendlv.proxy.GeodeticWgs84PositionReading"
STEERING, SPEED = "opendlv.proxy.GroundSteeringRequest", "opendlv.proxy.GroundSpeedRequest"
MOTION_REQUEST, POSE_ESTIMATE = "opendlv.proxy.GroundMotionRequest", "robot.PoseEstimate"
ODOMETRY_READING, PLANAR_SCAN = "robot.OdometryReading", "robot.PlanarScan"
BOX, PROPERTY, CLASS = (f"opendlv.logic.perception.Detection{name}" for name in ("BoundingBox", "Property", "Type"))

GIVEN: Mapping[str, tuple[tuple[str, ...], ...]] = {
    **dict.fromkeys((IMAGE, COMPRESSED, CAMERA_INFO), ((MEMORY,),)),
    LASER_SCAN: ((PLANAR_SCAN,),),
    RANGE: ((DISTANCE,),),
    IMU: ((ANGULAR, ACCELERATION),),
    NAV_SAT_FIX: ((GEOLOCATION,), (WGS84,)),
    ODOMETRY: ((ODOMETRY_READING,),),
    TWIST_STAMPED: ((ODOMETRY_READING,), (GROUND_SPEED, ANGULAR)),
}
"""The types of ``in``: what each is made of, the first that the test has of several ways."""

SENT: Mapping[str, tuple[str, ...]] = {
    **dict.fromkeys((TWIST, TWIST_STAMPED), (MOTION_REQUEST,)),
    **dict.fromkeys((ACKERMANN, ACKERMANN_STAMPED), (STEERING, SPEED)),
    DETECTIONS: (BOX, PROPERTY, CLASS),
    **dict.fromkeys((ODOMETRY, POSE_STAMPED, POSE_COVARIANCE), (POSE_ESTIMATE,)),
}
"""The types of ``out``: the messages that each becomes."""

NUMBERS = ("std_msgs/msg/Float32", "std_msgs/msg/Float64")
"""Types of one number: they need ``from`` or ``to``, a message with one number."""

FRAME_IDS: Mapping[str, str] = {
    **dict.fromkeys((IMAGE, COMPRESSED, CAMERA_INFO, DETECTIONS), "camera_optical_frame"),
    **{LASER_SCAN: "laser", RANGE: "range", IMU: "imu", NAV_SAT_FIX: "gps", ODOMETRY: "odom"},
    **dict.fromkeys((TWIST_STAMPED, ACKERMANN_STAMPED), "base_link"),
    **dict.fromkeys((POSE_STAMPED, POSE_COVARIANCE), "map"),
}
"""``header.frame_id`` by type where a topic does not say it, also of what a node sends (REP 103 and 105)."""

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
