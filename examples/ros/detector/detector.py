"""A ROS 2 node that finds yellow and blue crates: a picture of the camera in, boxes and their classes out."""

import contextlib
from collections.abc import Iterator

import numpy as np
import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import Image
from vision_msgs.msg import Detection2D, Detection2DArray, ObjectHypothesisWithPose

APART = 60  # of 255, by which a colour stands out
SMALLEST = 8  # pixels


class Detector(Node):
    """Answers each picture with the crates in it, also if there are none."""

    def __init__(self) -> None:
        super().__init__("detector")
        self.detections = self.create_publisher(Detection2DArray, "detections", 10)
        self.create_subscription(Image, "camera/image_raw", self.look, qos_profile_sensor_data)

    def look(self, image: Image) -> None:
        picture = np.frombuffer(image.data, np.uint8).reshape(image.height, image.width, 3)
        red, green, blue = (picture[..., channel].astype(int) for channel in range(3))
        answer = Detection2DArray(header=image.header)
        for name, mask in (("yellow", np.minimum(red, green) - blue > APART), ("blue", blue - red > APART)):
            answer.detections += [self.detection(image, name, box) for box in boxes(mask)]
        self.detections.publish(answer)

    def detection(self, image: Image, name: str, box: tuple[int, int, int, int]) -> Detection2D:
        left, top, right, bottom = box
        found = Detection2D(header=image.header)
        found.bbox.center.position.x, found.bbox.center.position.y = (left + right) / 2, (top + bottom) / 2
        found.bbox.size_x, found.bbox.size_y = float(right - left), float(bottom - top)
        hypothesis = ObjectHypothesisWithPose()
        hypothesis.hypothesis.class_id, hypothesis.hypothesis.score = name, 1.0
        found.results.append(hypothesis)
        return found


def boxes(mask: np.ndarray) -> Iterator[tuple[int, int, int, int]]:
    """Left, top, right and bottom of what stands side by side in a mask."""
    seen = np.flatnonzero(np.diff(mask.any(axis=0), prepend=False, append=False))
    for left, right in zip(seen[::2], seen[1::2], strict=True):
        rows = np.flatnonzero(mask[:, left:right].any(axis=1))
        if min(right - left, rows[-1] + 1 - rows[0]) >= SMALLEST:
            yield int(left), int(rows[0]), int(right), int(rows[-1] + 1)


def main() -> None:
    rclpy.init()
    with contextlib.suppress(KeyboardInterrupt, ExternalShutdownException):
        rclpy.spin(Detector())


if __name__ == "__main__":
    main()
