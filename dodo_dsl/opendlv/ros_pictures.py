"""Pictures of a shared memory as ROS' messages, and back.

Encodings are those of sensor_msgs' ``image_encodings.hpp``; a picture whose memory already has the order of its
encoding's bytes is not copied.
"""

import math
from typing import NamedTuple

import numpy as np

from dodo_dsl.opendlv.picture_size import problem_of, too_large
from dodo_dsl.opendlv.pixels import Picture, converted
from dodo_dsl.opendlv.ros_codec import Fields, RosTypeError
from dodo_dsl.opendlv.ros_types import CAMERA_INFO, COMPRESSED, IMAGE, CameraView, Topic

PICTURES = (IMAGE, COMPRESSED)
_FORMATS = {"bgr8": "bgr", "rgb8": "rgb", "bgra8": "argb", "rgba8": "rgba", "mono8": "mono"}
_BYTES = {"mono8": 1, "bgr8": 3, "rgb8": 3}
_ENCODINGS = {IMAGE: ("bgr8", "rgb8", "bgra8", "mono8"), COMPRESSED: ("png", "jpeg")}
"""Of topics that are given, the default first."""


class CameraPicture(NamedTuple):
    """The content of a memory as ``pixels.view`` has it, and its format there: argb, bgr or rgb."""

    pixels: Picture
    format: str


def picture_fields(topic: Topic, picture: CameraPicture | None) -> Fields:
    if topic.type == CAMERA_INFO and topic.camera:
        return _camera_info(topic.camera)
    if picture is None:
        raise RosTypeError(f"{topic.topic} needs a picture, or its camera")
    encoding = encoding_of(topic)
    wanted = _FORMATS.get(encoding, "bgr")
    image = picture.pixels if picture.format == wanted else converted(picture.pixels, picture.format, wanted)
    if topic.type == COMPRESSED:
        import cv2

        return {"format": encoding, "data": cv2.imencode(f".{encoding}", image)[1]}
    height, width = image.shape[:2]
    return {"height": height, "width": width, "encoding": encoding, "step": image.nbytes // height, "data": image}


def encoding_of(topic: Topic) -> str:
    known = _ENCODINGS[topic.type]
    if topic.encoding and topic.encoding not in known:
        raise RosTypeError(f"{topic.topic} has the encoding '{topic.encoding}', expected one of {', '.join(known)}")
    return topic.encoding or known[0]


def picture_of(type_: str, fields: Fields) -> Picture:
    """The picture of an Image or a CompressedImage as blue, green, red; raises RosTypeError."""
    data = fields["data"]
    if type_ == COMPRESSED:
        import cv2

        problem = problem_of(data.tobytes())
        found = None if problem else cv2.imdecode(data, cv2.IMREAD_COLOR)
        if found is None:
            raise RosTypeError(f"a picture of format '{fields['format']:.40}' cannot be read: {problem}")
        return np.asarray(found, np.uint8)
    encoding, width, height, step = (fields[name] for name in ("encoding", "width", "height", "step"))
    if encoding not in _FORMATS:
        raise RosTypeError(f"a picture has the encoding '{encoding:.40}', expected one of {', '.join(_FORMATS)}")
    row = width * _BYTES.get(encoding, 4)
    problem = too_large(width, height)
    if problem or not 0 < row <= step or not 0 < height * step <= len(data):
        of = f"{len(data)} bytes in rows of {step} are no {encoding} of {width} x {height} pixels"
        raise RosTypeError(problem or of)
    image = data[: height * step].reshape(height, step)[:, :row].reshape(height, width, -1)
    return np.asarray(image, np.uint8) if encoding == "bgr8" else converted(image, _FORMATS[encoding], "bgr")


def _camera_info(camera: CameraView) -> Fields:
    """A pinhole camera that looks along z, x to the right; the centre of the first pixel is at 0."""
    focal = camera.height / 2 / math.tan(math.radians(camera.fovy) / 2)
    x, y = (camera.width - 1) / 2, (camera.height - 1) / 2
    return {
        "height": camera.height,
        "width": camera.width,
        "distortion_model": "plumb_bob",
        "d": [0.0] * 5,
        "k": [focal, 0.0, x, 0.0, focal, y, 0.0, 0.0, 1.0],
        "r": [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
        "p": [focal, 0.0, x, 0.0, 0.0, focal, y, 0.0, 0.0, 0.0, 1.0, 0.0],
    }
