"""Programs with rclpy alone: ``node`` answers each picture by a Twist, ``drive`` so that it stays on a shipped track,
and ``pictures N`` sends N and waits for answers.

They need no DoDo. ``pictures`` prints the times of its round trips and the processor time a picture, in ms, as JSON.
"""

import contextlib
import json
import sys
import time

import numpy as np
import rclpy
from geometry_msgs.msg import Twist
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from sensor_msgs.msg import Image

WIDTH, HEIGHT = 640, 480


def answer() -> None:
    node = Node("lane")
    out = node.create_publisher(Twist, "/cmd_vel", 10)

    def take(image: Image) -> None:
        twist = Twist()
        twist.linear.x = float(image.data[-1])
        out.publish(twist)

    node.create_subscription(Image, "/camera", take, 10)
    with contextlib.suppress(KeyboardInterrupt, ExternalShutdownException):
        rclpy.spin(node)


def drive() -> None:
    node = Node("lane")
    out = node.create_publisher(Twist, "/cmd_vel", 10)

    def middle(colour: np.ndarray, otherwise: float) -> float:
        return float(np.nonzero(colour)[1].mean() / WIDTH - 0.5) if colour.any() else otherwise

    def take(image: Image) -> None:
        rows = np.frombuffer(bytes(image.data), np.uint8).reshape(image.height, image.width, 3)[280:340].astype(int)
        blue, green, red = rows[..., 0], rows[..., 1], rows[..., 2]
        twist = Twist()
        twist.linear.x = 0.6
        twist.angular.z = -3 * (middle(green - blue > 30, -0.5) + middle(blue - red > 30, 0.5))
        out.publish(twist)

    node.create_subscription(Image, "/camera", take, 10)
    with contextlib.suppress(KeyboardInterrupt, ExternalShutdownException):
        rclpy.spin(node)


def pictures(count: int) -> None:
    node = Node("camera")
    out = node.create_publisher(Image, "/camera", 10)
    answers: list[Twist] = []
    node.create_subscription(Twist, "/cmd_vel", answers.append, 10)
    while not out.get_subscription_count() or not node.count_publishers("/cmd_vel"):
        rclpy.spin_once(node, timeout_sec=0.05)
    message = Image(width=WIDTH, height=HEIGHT, step=WIDTH * 3, encoding="bgr8")
    times, begin = [], 0.0
    for number in range(-count // 10, count):
        if number == 0:
            begin = time.process_time()
        answers.clear()
        start = time.perf_counter()
        message.data = bytes([number % 256]) * (WIDTH * HEIGHT * 3)
        out.publish(message)
        while not answers and time.perf_counter() - start < 1.0:
            rclpy.spin_once(node, timeout_sec=1.0)
        times.append((time.perf_counter() - start) * 1000)
    print(json.dumps([times[-count:], (time.process_time() - begin) / count * 1000]))


rclpy.init()
if sys.argv[1] == "pictures":
    pictures(int(sys.argv[2]))
else:
    {"node": answer, "drive": drive}[sys.argv[1]]()
