"""Pictures of a shared memory as ROS' messages, and back.

Encodings are those of sensor_msgs' ``image_encodings.hpp``; a picture whose memory already has the order of its
encoding's bytes is not copied.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from dodo_dsl.opendlv import pixels
from dodo_dsl.opendlv.picture_size import problem_of, too_large
from dodo_dsl.opendlv.pixels import Picture
from dodo_dsl.opendlv.ros_codec import Fields, RosTypeError
from dodo_dsl.opendlv.ros_fields import CAMERA_INFO, COMPRESSED, IMAGE
from dodo_dsl.opendlv.ros_types import CameraView, Topic

PICTURES = (IMAGE, COMPRESSED)
_SAME = {"argb": "bgra8", "bgr": "bgr8", "rgb": "rgb8"}
_CHANNELS = {"bgr8": 3, "rgb8": 3, "bgra8": 4, "rgba8": 4, "mono8": 1}
_ORDER = {"bgr8": "BGR", "rgb8": "RGB", "bgra8": "BGRA", "rgba8": "RGBA", "mono8": "GRAY"}
ENCODINGS = {IMAGE: ("bgr8", "rgb8", "bgra8", "mono8"), COMPRESSED: ("png", "jpeg")}
"""Of topics that are given, the default first."""
_JPEG_QUALITY = 95


class CameraPicture(NamedTuple):
    """The content of a memory as ``pixels.view`` has it, and its format there."""

    pixels: Picture
    format: str

    @classmethod
    def of(cls, data: Any, format_: str, width: int, height: int) -> "CameraPicture":
        """The picture in the bytes of a memory, without a copy; raises PixelError."""
        return cls(pixels.view(data, format_, width, height), format_)


def picture_fields(topic: Topic, picture: CameraPicture | None) -> Fields:
    """The fields of a picture, or of what is known of its camera, without the header; raises RosTypeError."""
    if topic.type == CAMERA_INFO:
        if topic.camera is None or not topic.camera.fovy * topic.camera.height:
            raise RosTypeError(f"{topic.topic} needs its camera's size and opening angle")
        return _camera_info(topic.camera)
    if picture is None:
        raise RosTypeError(f"{topic.topic} needs a picture")
    encoding = encoding_of(topic)
    if topic.type == COMPRESSED:
        return _compressed(encoding, picture)
    image = _ordered(picture, encoding)
    height, width = image.shape[:2]
    step = width * _CHANNELS[encoding]
    return {"height": height, "width": width, "encoding": encoding, "is_bigendian": 0, "step": step, "data": image}


def encoding_of(topic: Topic) -> str:
    """That of a topic's pictures; raises RosTypeError for one that its type does not have."""
    known = ENCODINGS[topic.type]
    if topic.encoding and topic.encoding not in known:
        raise RosTypeError(f"{topic.topic} has the encoding '{topic.encoding}', expected one of {', '.join(known)}")
    return topic.encoding or known[0]


def picture_of(type_: str, fields: Fields) -> Picture:
    """The picture of an Image or a CompressedImage as blue, green, red; raises RosTypeError."""
    import cv2

    if type_ == COMPRESSED:
        data = fields["data"].tobytes()
        if problem := problem_of(data):
            raise RosTypeError(f"a picture of format '{fields['format']:.40}' cannot be read: {problem}")
        found = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
        if found is None:
            raise RosTypeError(f"a picture of format '{fields['format']:.40}' cannot be decoded")
        return np.asarray(found, np.uint8)
    encoding, width, height, step = (fields[name] for name in ("encoding", "width", "height", "step"))
    if encoding not in _CHANNELS:
        raise RosTypeError(f"a picture has the encoding '{encoding:.40}', expected one of {', '.join(_CHANNELS)}")
    row = width * _CHANNELS[encoding]
    if (
        (problem := too_large(width, height))
        or not row
        or not height
        or step < row
        or len(fields["data"]) < height * step
    ):
        of = f"{len(fields['data'])} bytes in rows of {step} are no {encoding} of {width} x {height} pixels"
        raise RosTypeError(problem or of)
    rows = np.asarray(fields["data"][: height * step]).reshape(height, step)[:, :row]
    image = rows.reshape(height, width, -1)
    if encoding == "bgr8":
        return image
    code = getattr(cv2, f"COLOR_{_ORDER[encoding]}2BGR")
    return np.asarray(cv2.cvtColor(np.ascontiguousarray(image), code), np.uint8)


def _ordered(picture: CameraPicture, encoding: str) -> Picture:
    image, format_ = picture
    if _SAME.get(format_) == encoding:
        return image
    import cv2

    if format_ == "i420":
        image, format_ = pixels.to_bgr(image, format_), "bgr"
        if encoding == "bgr8":
            return image
    code = getattr(cv2, f"COLOR_{_ORDER[_SAME[format_]]}2{_ORDER[encoding]}")
    return np.asarray(cv2.cvtColor(image, code), np.uint8)


def _compressed(format_: str, picture: CameraPicture) -> Fields:
    import cv2

    options = [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY] if format_ == "jpeg" else []
    done, data = cv2.imencode(".jpg" if format_ == "jpeg" else ".png", _ordered(picture, "bgr8"), options)
    if not done:
        raise RosTypeError(f"a picture cannot be encoded as {format_}")
    return {"format": format_, "data": data}


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
