"""Where the fields of the bus' messages are in ROS types, and what else such a type says.

Both have SI units and the axes of REP 103 (x forward, y left, z up; angles counterclockwise, so steering to the left is
positive), degrees for places on earth, and infinity for a distance in which nothing is (REP 117): no number changes.
"""

from collections.abc import Mapping
from typing import Any

from dodo_dsl.opendlv import ros_types as ros

Paths = Mapping[str, str]


def _axes(fields: str, path: str) -> dict[str, str]:
    return {field: f"{path}.{axis}" for field, axis in zip(fields.split(), "xyzw", strict=False)}


def _motion(path: str) -> Paths:
    return _axes("vx vy vz", f"{path}linear") | _axes("rollRate pitchRate yawRate", f"{path}angular")


def _pose(path: str) -> Paths:
    return _axes("x y z", f"{path}.position") | _axes("qx qy qz qw", f"{path}.orientation")


_RATES = "angularVelocityX angularVelocityY angularVelocityZ"
_FORCES = "accelerationX accelerationY accelerationZ"
_PLANAR = {"vx": "twist.linear.x", "vy": "twist.linear.y", "yawRate": "twist.angular.z"}

PATHS: Mapping[tuple[str, str], Paths] = {
    (ros.TWIST, ros.MOTION_REQUEST): _motion(""),
    (ros.TWIST_STAMPED, ros.MOTION_REQUEST): _motion("twist."),
    (ros.TWIST_STAMPED, ros.ODOMETRY_READING): _PLANAR,
    (ros.TWIST_STAMPED, ros.GROUND_SPEED): {"groundSpeed": "twist.linear.x"},
    (ros.TWIST_STAMPED, ros.ANGULAR): _axes(_RATES, "twist.angular"),
    (ros.ACKERMANN, ros.STEERING): {"groundSteering": "steering_angle"},
    (ros.ACKERMANN, ros.SPEED): {"groundSpeed": "speed"},
    (ros.ACKERMANN_STAMPED, ros.STEERING): {"groundSteering": "drive.steering_angle"},
    (ros.ACKERMANN_STAMPED, ros.SPEED): {"groundSpeed": "drive.speed"},
    (ros.ODOMETRY, ros.ODOMETRY_READING): _axes("x y", "pose.pose.position")
    | {"yaw": "pose.pose.orientation"}
    | {field: f"twist.{path}" for field, path in _PLANAR.items()},
    (ros.ODOMETRY, ros.POSE_ESTIMATE): _pose("pose.pose"),
    (ros.POSE_STAMPED, ros.POSE_ESTIMATE): _pose("pose"),
    (ros.POSE_COVARIANCE, ros.POSE_ESTIMATE): _pose("pose.pose"),
    (ros.IMU, ros.ANGULAR): _axes(_RATES, "angular_velocity"),
    (ros.IMU, ros.ACCELERATION): _axes(_FORCES, "linear_acceleration"),
    (ros.NAV_SAT_FIX, ros.GEOLOCATION): {field: field for field in ("latitude", "longitude", "altitude")},
    (ros.NAV_SAT_FIX, ros.WGS84): {field: field for field in ("latitude", "longitude")},
    (ros.RANGE, ros.DISTANCE): {"distance": "range"},
    (ros.LASER_SCAN, ros.PLANAR_SCAN): {
        "angleMin": "angle_min",
        "angleIncrement": "angle_increment",
        "rangeMin": "range_min",
        "rangeMax": "range_max",
        "ranges": "ranges",
    },
}
"""The path of each field, by the ROS type and the message. ``yaw`` is an attitude there, and ``ranges`` a list."""

CONSTANTS: Mapping[str, Mapping[str, Any]] = {
    ros.IMU: {"orientation": {"w": 1.0}, "orientation_covariance": [-1.0] + [0.0] * 8},
    ros.NAV_SAT_FIX: {"status": {"status": 0, "service": 1}, "altitude": float("nan")},
    ros.RANGE: {"max_range": float("inf")},
    ros.ODOMETRY: {"child_frame_id": "base_link"},
}
"""What a type holds beside its messages' fields; the rest is 0 or empty. An Imu's orientation is not measured, and
NavSatFix has NaN for no altitude."""

DEFINITIONS: Mapping[str, str] = {
    ros.ACKERMANN: """
float32 steering_angle
float32 steering_angle_velocity
float32 speed
float32 acceleration
float32 jerk
""",
    ros.ACKERMANN_STAMPED: "std_msgs/Header header\nackermann_msgs/AckermannDrive drive\n",
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
    ros.DETECTIONS: "std_msgs/Header header\nvision_msgs/Detection2D[] detections\n",
}
"""Types of ackermann_msgs 2 and vision_msgs 4, which are not among ROS' standard ones."""
