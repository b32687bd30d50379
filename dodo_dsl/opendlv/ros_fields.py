"""Where the fields of the bus' messages are in ROS types, and what else such a type says.

Both have SI units and the axes of REP 103 (x forward, y left, z up; angles counterclockwise, so steering to the left is
positive), degrees for places on earth, and infinity for a distance in which nothing is (REP 117): no number changes.
"""

from collections.abc import Mapping
from typing import Any

from dodo_dsl.opendlv import ros_types
from dodo_dsl.opendlv.ros_types import MOTION_REQUEST, POSE_ESTIMATE

ANGULAR, ACCELERATION = "opendlv.proxy.AngularVelocityReading", "opendlv.proxy.AccelerationReading"
DISTANCE, GROUND_SPEED = "opendlv.proxy.DistanceReading", "opendlv.proxy.GroundSpeedReading"
GEOLOCATION, WGS84 = "opendlv.logic.sensation.Geolocation", "opendlv.proxy.GeodeticWgs84PositionReading"
STEERING, SPEED = "opendlv.proxy.GroundSteeringRequest", "opendlv.proxy.GroundSpeedRequest"
ODOMETRY, SCAN = "robot.OdometryReading", "robot.PlanarScan"

DETECTIONS = "vision_msgs/msg/Detection2DArray"
IMAGE, COMPRESSED, CAMERA_INFO = (f"sensor_msgs/msg/{name}" for name in ("Image", "CompressedImage", "CameraInfo"))
LASER_SCAN, RANGE, IMU, NAV_SAT_FIX = (f"sensor_msgs/msg/{name}" for name in ("LaserScan", "Range", "Imu", "NavSatFix"))
ODOMETRY_TYPE, TWIST_STAMPED = "nav_msgs/msg/Odometry", "geometry_msgs/msg/TwistStamped"

Paths = Mapping[str, str]


def _axes(fields: str, path: str) -> dict[str, str]:
    return {field: f"{path}.{axis}" for field, axis in zip(fields.split(), "xyzw", strict=False)}


def _motion(path: str) -> Paths:
    return _axes("vx vy vz", f"{path}linear") | _axes("rollRate pitchRate yawRate", f"{path}angular")


def _pose(path: str) -> Paths:
    return _axes("x y z", f"{path}.position") | _axes("qx qy qz qw", f"{path}.orientation")


_RATES = "angularVelocityX angularVelocityY angularVelocityZ"
_FORCES = "accelerationX accelerationY accelerationZ"
_PLANAR = {"vx": "twist{}.linear.x", "vy": "twist{}.linear.y", "yawRate": "twist{}.angular.z"}

PATHS: Mapping[tuple[str, str], Paths] = {
    ("geometry_msgs/msg/Twist", MOTION_REQUEST): _motion(""),
    (TWIST_STAMPED, MOTION_REQUEST): _motion("twist."),
    (TWIST_STAMPED, ODOMETRY): {field: path.format("") for field, path in _PLANAR.items()},
    (TWIST_STAMPED, GROUND_SPEED): {"groundSpeed": "twist.linear.x"},
    (TWIST_STAMPED, ANGULAR): _axes(_RATES, "twist.angular"),
    ("ackermann_msgs/msg/AckermannDrive", STEERING): {"groundSteering": "steering_angle"},
    ("ackermann_msgs/msg/AckermannDrive", SPEED): {"groundSpeed": "speed"},
    ("ackermann_msgs/msg/AckermannDriveStamped", STEERING): {"groundSteering": "drive.steering_angle"},
    ("ackermann_msgs/msg/AckermannDriveStamped", SPEED): {"groundSpeed": "drive.speed"},
    (ODOMETRY_TYPE, ODOMETRY): _axes("x y", "pose.pose.position")
    | {"yaw": "pose.pose.orientation"}
    | {field: path.format(".twist") for field, path in _PLANAR.items()},
    (ODOMETRY_TYPE, POSE_ESTIMATE): _pose("pose.pose"),
    ("geometry_msgs/msg/PoseStamped", POSE_ESTIMATE): _pose("pose"),
    ("geometry_msgs/msg/PoseWithCovarianceStamped", POSE_ESTIMATE): _pose("pose.pose"),
    (IMU, ANGULAR): _axes(_RATES, "angular_velocity"),
    (IMU, ACCELERATION): _axes(_FORCES, "linear_acceleration"),
    (NAV_SAT_FIX, GEOLOCATION): {field: field for field in ("latitude", "longitude", "altitude")},
    (NAV_SAT_FIX, WGS84): {field: field for field in ("latitude", "longitude")},
    (RANGE, DISTANCE): {"distance": "range"},
    (LASER_SCAN, SCAN): {
        "angleMin": "angle_min",
        "angleIncrement": "angle_increment",
        "rangeMin": "range_min",
        "rangeMax": "range_max",
        "ranges": "ranges",
    },
}
"""The path of each field, by the ROS type and the message. ``yaw`` is an attitude there, and ``ranges`` a list."""

MAY_BE_INFINITE = {(DISTANCE, "distance"), (SCAN, "rangeMax")}

FRAME_IDS: Mapping[str, str] = {
    **ros_types.FRAME_IDS,
    DETECTIONS: "camera_optical_frame",
    "ackermann_msgs/msg/AckermannDriveStamped": "base_link",
    "geometry_msgs/msg/PoseStamped": "map",
    "geometry_msgs/msg/PoseWithCovarianceStamped": "map",
}
"""``header.frame_id`` where a topic does not say it, also of what a node sends."""

UNKNOWN = [-1.0] + [0.0] * 8
"""The covariance of an Imu's quantity that is not measured."""

CONSTANTS: Mapping[str, Mapping[str, Any]] = {
    IMU: {"orientation": {"w": 1.0}, "orientation_covariance": UNKNOWN},
    NAV_SAT_FIX: {"status": {"status": 0, "service": 1}, "altitude": float("nan")},
    RANGE: {"max_range": float("inf")},
    ODOMETRY_TYPE: {"child_frame_id": "base_link", "pose": {"pose": {"orientation": {"w": 1.0}}}},
    "geometry_msgs/msg/PoseStamped": {"pose": {"orientation": {"w": 1.0}}},
}
"""What a type holds beside its messages' fields; the rest is 0 or empty. NavSatFix has NaN for no altitude."""

DEFINITIONS: Mapping[str, str] = {
    "ackermann_msgs/msg/AckermannDrive": """
float32 steering_angle
float32 steering_angle_velocity
float32 speed
float32 acceleration
float32 jerk
""",
    "ackermann_msgs/msg/AckermannDriveStamped": "std_msgs/Header header\nackermann_msgs/AckermannDrive drive\n",
    "vision_msgs/msg/Point2D": "float64 x\nfloat64 y\n",
    "vision_msgs/msg/Pose2D": "vision_msgs/Point2D position\nfloat64 theta\n",
    "vision_msgs/msg/BoundingBox2D": "vision_msgs/Pose2D center\nfloat64 size_x\nfloat64 size_y\n",
    "vision_msgs/msg/ObjectHypothesis": "string class_id\nfloat64 score\n",
    "vision_msgs/msg/ObjectHypothesisWithPose": """
vision_msgs/ObjectHypothesis hypothesis
geometry_msgs/PoseWithCovariance pose
""",
    "vision_msgs/msg/Detection2D": """
std_msgs/Header header
vision_msgs/ObjectHypothesisWithPose[] results
vision_msgs/BoundingBox2D bbox
string id
""",
    DETECTIONS: "std_msgs/Header header\nvision_msgs/Detection2D[] detections\n",
}
"""Types of ackermann_msgs 2 and vision_msgs 4, which are not among ROS' standard ones."""
