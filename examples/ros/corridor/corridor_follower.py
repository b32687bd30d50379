"""A ROS 2 node that keeps to the middle of a corridor: a laser scan in, steering and speed out."""

import contextlib
import math

import numpy as np
import rclpy
from ackermann_msgs.msg import AckermannDriveStamped
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import LaserScan

SIDES = (math.radians(30), math.radians(80))  # from ahead, between which it looks to either side
STEEPEST = math.radians(25)


class CorridorFollower(Node):
    """Steers to the side on which there is more room."""

    def __init__(self) -> None:
        super().__init__("corridor_follower")
        self.speed = self.declare_parameter("speed", 0.8).value  # m/s
        self.gain = self.declare_parameter("gain", 1.2).value  # rad, where a side has all the room
        self.drive = self.create_publisher(AckermannDriveStamped, "drive", 10)
        self.create_subscription(LaserScan, "scan", self.look, qos_profile_sensor_data)

    def look(self, scan: LaserScan) -> None:
        """Answers a scan with steering and speed, under the scan's stamp."""
        angles = scan.angle_min + scan.angle_increment * np.arange(len(scan.ranges))
        ranges = np.clip(np.asarray(scan.ranges), scan.range_min, scan.range_max)
        left, right = (float(ranges[(SIDES[0] < side) & (side < SIDES[1])].mean()) for side in (angles, -angles))
        answer = AckermannDriveStamped()
        answer.header.stamp = scan.header.stamp
        answer.header.frame_id = "base_link"
        answer.drive.steering_angle = float(np.clip(self.gain * (left - right) / (left + right), -STEEPEST, STEEPEST))
        answer.drive.speed = self.speed
        self.drive.publish(answer)


def main() -> None:
    rclpy.init()
    with contextlib.suppress(KeyboardInterrupt, ExternalShutdownException):
        rclpy.spin(CorridorFollower())


if __name__ == "__main__":
    main()
