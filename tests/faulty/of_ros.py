"""A node of examples/ros with one fault: python of_ros.py NODE FAULT, in the node's folder and on ROS' own Python.

It stands alone, as a test copies it beside the node, where nothing of DoDo is to be had.
"""

import importlib
import math
import sys
from collections import deque
from collections.abc import Callable
from typing import Any

Make = Callable[[Any], None]
LATE = 5
"""Answers that are held back."""


def _published(change: Callable[[Any], Any]) -> Make:
    """What a node publishes, changed; None is not sent."""

    def make(module: Any) -> None:
        publisher = importlib.import_module("rclpy.publisher").Publisher
        publish = publisher.publish

        def altered(self: Any, message: Any) -> None:
            own = any(hasattr(message, field) for field in ("drive", "angular", "detections"))
            if (other := change(message) if own else message) is not None:
                publish(self, other)

        publisher.publish = altered

    return make


def _heard(choose: Callable[[list[Any]], Any]) -> Make:
    """Which of all messages so far a node takes for the newest."""

    def make(module: Any) -> None:
        node = next(each for each in vars(module).values() if isinstance(each, type) and module.Node in each.__bases__)
        look, seen = node.look, []

        def altered(self: Any, message: Any) -> None:
            seen.append(message)
            look(self, choose(seen))

        node.look = altered

    return make


def _other_sign(message: Any) -> Any:
    if hasattr(message, "drive"):
        message.drive.steering_angle *= -1
    else:
        message.angular.z *= -1
    return message


def _degrees(message: Any) -> Any:
    message.drive.steering_angle = math.degrees(message.drive.steering_angle)
    return message


def _unstamped(message: Any) -> Any:
    message.header.stamp.sec = message.header.stamp.nanosec = 0
    return message


def _in_frame(name: str) -> Callable[[Any], Any]:
    def change(message: Any) -> Any:
        message.header.frame_id = name
        return message

    return change


def _late() -> Callable[[Any], Any]:
    waiting: deque[Any] = deque()

    def change(message: Any) -> Any:
        waiting.append(message)
        return waiting.popleft() if len(waiting) > LATE else None

    return change


def _nothing(_: Any) -> None:
    """What is wrong is around the node."""


FAULTS: dict[str, Make] = {
    "ros-frame-ignored": _heard(lambda seen: seen[0]),
    "ros-steering-sign": _published(_other_sign),
    "ros-ackermann-sign": _published(_other_sign),
    "ros-degrees": _published(_degrees),
    "ros-scan-stale": _heard(lambda seen: seen[max(0, len(seen) - 20)]),
    "ros-frame-id": _published(_in_frame("map")),
    "ros-unstamped": _published(_unstamped),
    "ros-answer-late": _published(_late()),
    "ros-best-effort-lost": _nothing,
}

if __name__ == "__main__":
    node = importlib.import_module(sys.argv[1])
    FAULTS[sys.argv[2]](node)
    node.main()
