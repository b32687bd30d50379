"""A ROS 2 node that keeps between two white lines: a picture of the camera in, a velocity out."""

import contextlib

import numpy as np
import rclpy
from geometry_msgs.msg import Twist
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import Image

WHITE = 200
ROWS = (0.65, 0.8)  # of the picture's height, in which it looks for the lines


class LaneFollower(Node):
    """Steers towards the middle between the lines that it sees."""

    def __init__(self) -> None:
        super().__init__("lane_follower")
        self.speed = self.declare_parameter("speed", 0.4).value  # m/s
        self.gain = self.declare_parameter("gain", 2.0).value  # rad/s, where the lane's middle is at the picture's edge
        self.velocity = self.create_publisher(Twist, "cmd_vel", 10)
        self.create_subscription(Image, "camera/image_raw", self.look, qos_profile_sensor_data)

    def look(self, image: Image) -> None:
        """Answers a picture with a velocity."""
        picture = np.frombuffer(image.data, np.uint8).reshape(image.height, image.width, image.step // image.width)
        answer = Twist()
        answer.linear.x = self.speed
        answer.angular.z = self.gain * middle(picture[..., :3])
        self.velocity.publish(answer)


def middle(picture: np.ndarray) -> float:
    """Where the middle between the lines is: 1 at the left edge of the picture, -1 at the right one."""
    height, width, _ = picture.shape
    rows = picture[int(ROWS[0] * height) : int(ROWS[1] * height)]
    columns = np.nonzero(rows.min(axis=2) > WHITE)[1]
    left, right = columns[columns < width // 2], columns[columns >= width // 2]
    from_left = left.mean() if len(left) else 0.0
    from_right = right.mean() if len(right) else width
    return float(1 - (from_left + from_right) / width)


def main() -> None:
    rclpy.init()
    with contextlib.suppress(KeyboardInterrupt, ExternalShutdownException):
        rclpy.spin(LaneFollower())


if __name__ == "__main__":
    main()
