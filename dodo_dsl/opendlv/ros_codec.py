"""ROS 2 messages and their bytes (CDR in little endian with its header), as mappings of their fields.

Reference: OMG, "DDS-XTypes" 1.3, section 7.4.3; ROS 2, "Interface definition".
"""

import importlib.util
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from dodo_dsl.opendlv.ros_fields import DEFINITIONS

Fields = dict[str, Any]
_BASE, _NAME, _ARRAY = 1, 2, 3
_DTYPES = {"bool": "bool_", "char": "uint8", "byte": "int8"}
_OCTETS = (4, ((_BASE, ("uint8", 0)), 0))


class RosTypeError(ValueError):
    """A type that is not known, values that do not fit it, or bytes that are none of it; one sentence."""

    usage = True


def require_ros(*modules: str) -> None:
    """Raises RosTypeError where ``modules``, else all of DoDo's extra ``ros``, are not installed."""
    missing = [name for name in modules or ("rosbags", "cyclonedds") if importlib.util.find_spec(name) is None]
    if missing:
        raise RosTypeError(f"ROS 2 needs {' and '.join(missing)} of DoDo's extra 'ros', which this Python lacks")


class Codec:
    """The standard types of ROS 2 (Kilted), those of ackermann_msgs and vision_msgs, and own types.

    ``own_files`` are ``.msg`` and ``.idl`` files. The package of a ``.msg`` file is the folder above its folder
    ``msg``, or else the folder that it is in; ``.idl`` files say it themselves. Raises RosTypeError.
    """

    def __init__(self, own_files: Sequence[Path] = ()) -> None:
        require_ros("rosbags")
        from rosbags.typesys import Stores, TypesysError, get_types_from_msg, get_typestore

        self.store: Any = get_typestore(Stores.ROS2_KILTED)
        """The typestore of rosbags, for bags."""
        types: dict[str, Any] = {}
        for path in own_files:
            types |= _definitions(path)
        self.own = tuple(types)
        """The names of own types."""
        for name in DEFINITIONS.keys() - types.keys():
            types |= get_types_from_msg(DEFINITIONS[name], name)
        try:
            self.store.register(types)
            for name in self.own:
                self.store.generate_msgdef(name, ros_version=2)  # also of its parts, where all are known
        except TypesysError as error:
            raise RosTypeError(f"own types do not fit: {error}") from None

    def encode(self, type_: str, fields: Mapping[str, Any]) -> bytes:
        """The bytes of a message; fields that are left out are 0 or empty. Raises RosTypeError."""
        last, desc = self._fields(type_)[-1]
        octets = fields.get(last) if desc == _OCTETS else None
        try:
            message = self._built((_NAME, type_), fields if octets is None else {**fields, last: None})
            head = self.store.serialize_cdr(message, type_, little_endian=True)
            if octets is None:
                return bytes(head)
            data = np.ascontiguousarray(octets, np.uint8)
            return b"".join((head[:-4], data.nbytes.to_bytes(4, "little"), data.data))  # a picture is copied once
        except Exception as error:  # noqa: BLE001 - whatever rosbags and what is below it raise of values
            raise RosTypeError(f"a value does not fit {type_}: {error}") from None

    def decode(self, type_: str, data: bytes | memoryview) -> Fields:
        self._fields(type_)
        try:
            return dict(self._plain(self.store.deserialize_cdr(data, type_)))
        except Exception as error:  # noqa: BLE001 - as above, of bytes
            raise RosTypeError(f"{len(data)} bytes are no {type_}: {error}") from None

    def fields(self, type_: str) -> tuple[str, ...]:
        return tuple(name for name, _ in self._fields(type_))

    def has_header(self, type_: str) -> bool:
        return ("header", (_NAME, "std_msgs/msg/Header")) in self._fields(type_)

    def check_path(self, type_: str, path: str) -> None:
        """Raises RosTypeError where a type has no such path (``pose.pose.position.x``)."""
        desc: Any = (_NAME, type_)
        for name in path.split("."):
            known = dict(self._fields(desc[1])) if desc[0] == _NAME else {}
            if name not in known:
                there = ", ".join(known) or "no fields"
                raise RosTypeError(f"{type_} has no '{path}': there is no '{name}' among {there}")
            desc = known[name]

    def _fields(self, type_: str) -> Sequence[tuple[str, Any]]:
        if type_ not in self.store.fielddefs:
            raise RosTypeError(f"the ROS type '{type_}' is not known: expected package/msg/Name, or its file")
        return tuple(self.store.fielddefs[type_][1])

    def _built(self, desc: Any, value: Any) -> Any:
        kind, of = desc
        if kind == _NAME:
            given = value or {}
            return self.store.types[of](*(self._built(each, given.get(name)) for name, each in self._fields(of)))
        if kind == _BASE:
            return value if value is not None else "" if of[0] == "string" else 0
        inner, count = of
        count = count if kind == _ARRAY else 0
        if inner[0] == _NAME or inner[1][0] == "string":
            return [self._built(inner, each) for each in ([None] * count if value is None else value)]
        dtype = _DTYPES.get(inner[1][0], inner[1][0])
        return np.zeros(count, dtype) if value is None else np.ascontiguousarray(value, dtype)

    def _plain(self, value: Any) -> Any:
        if isinstance(value, list):
            return [self._plain(each) for each in value]
        if type_ := getattr(value, "__msgtype__", ""):  # which is the last of its fields
            return dict(zip(self.fields(type_), map(self._plain, vars(value).values()), strict=False))
        return value


def _definitions(path: Path) -> dict[str, Any]:
    from rosbags.typesys import TypesysError, get_types_from_idl, get_types_from_msg

    try:
        text = path.read_text(encoding="utf-8")
        return dict(get_types_from_idl(text) if path.suffix == ".idl" else get_types_from_msg(text, own_name(path)))
    except (OSError, UnicodeDecodeError, TypesysError) as error:
        raise RosTypeError(f"{path}: {getattr(error, 'strerror', None) or ' '.join(str(error).split())}") from None


def own_name(path: Path) -> str:
    """The type of a ``.msg`` file: ``lane_msgs/msg/Lane`` for ``lane_msgs/msg/Lane.msg`` and ``lane_msgs/Lane.msg``."""
    folders = path.absolute().parent.parts
    package = folders[-2] if len(folders) > 1 and folders[-1] == "msg" else folders[-1]
    return f"{package}/msg/{path.stem}"
