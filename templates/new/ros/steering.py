"""A ROS 2 node that drives between yellow cones on the left and blue ones on the right."""

import contextlib

import numpy as np
import rclpy
from geometry_msgs.msg import Twist
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import Image


class Steering(Node):
    def __init__(self) -> None:
        super().__init__("steering")
        self.velocity = self.create_publisher(Twist, "cmd_vel", 10)
        self.create_subscription(Image, "camera/image_raw", self.look, qos_profile_sensor_data)

    def look(self, image: Image) -> None:
        """Answers a picture, in the encoding bgr8 or bgra8, with a velocity."""
        pixels = np.frombuffer(image.data, np.uint8).reshape(image.height, image.width, image.step // image.width)
        strip = pixels[image.height * 7 // 12 : image.height * 17 // 24]
        blue, green, red = (strip[:, :, channel].astype(int) for channel in range(3))
        left, right = middle(green - blue > 80, -0.5), middle(blue - red > 20, 0.5)
        answer = Twist()
        answer.linear.x = 0.5  # m/s
        answer.angular.z = -2 * (left + right)  # rad/s, positive to the left
        self.velocity.publish(answer)


def middle(cones: np.ndarray, without: float) -> float:
    """Where the cones are: -0.5 is the left edge of the picture, 0.5 the right one."""
    return float(np.nonzero(cones)[1].mean() / cones.shape[1] - 0.5) if cones.any() else without


def main() -> None:
    rclpy.init()
    with contextlib.suppress(KeyboardInterrupt, ExternalShutdownException):
        rclpy.spin(Steering())


if __name__ == "__main__":
    main()
