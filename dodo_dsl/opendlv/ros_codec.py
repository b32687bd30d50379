"""ROS 2 messages and their bytes (CDR in little endian with its header), as mappings of their fields.

Reference: OMG, "DDS-XTypes" 1.3, section 7.4.3; ROS 2, "Interface definition".
"""

import importlib.util
import struct
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from dodo_dsl.opendlv.ros_fields import DEFINITIONS

Fields = dict[str, Any]
HEADER = "std_msgs/msg/Header"
_BASE, _NAME, _ARRAY = 1, 2, 3
_DTYPES = {"bool": "bool_", "char": "uint8", "byte": "int8"}
_OCTETS = (4, ((_BASE, ("uint8", 0)), 0))
_MISFITS = (
    ArithmeticError,
    AssertionError,
    AttributeError,
    LookupError,
    MemoryError,
    TypeError,
    ValueError,
    struct.error,
)
"""What rosbags raises for values and bytes that do not fit, beside its own error."""
_TEXTS = ("string", "wstring")
_LARGEST_DEFINITION = 1 << 20


class RosTypeError(ValueError):
    """A type that is not known, values that do not fit it, or bytes that are none of it; one sentence."""


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
        from rosbags.typesys.base import normalize_fieldname

        self._store: Any = get_typestore(Stores.ROS2_KILTED)
        self._python_name = normalize_fieldname
        own: dict[str, Any] = {}
        for path in own_files:
            own.update(_definitions(path))
        self.own = tuple(own)
        """The names of own types."""
        shipped = {name: text for name, text in DEFINITIONS.items() if name not in own}
        for name, text in shipped.items():
            own.update(get_types_from_msg(text, name))
        try:
            self._store.register(own)
        except TypesysError as error:
            raise RosTypeError(f"own types do not fit: {error}") from None
        for name in own:
            self._refuse_unknown_parts(name)

    @property
    def store(self) -> Any:
        """The typestore of rosbags, for bags."""
        return self._store

    def encode(self, type_: str, fields: Mapping[str, Any]) -> bytes:
        """The bytes of a message; fields that are left out are 0 or empty. Raises RosTypeError."""
        from rosbags.serde import SerdeError

        last, desc = self._store.fielddefs[self._known(type_)][1][-1]
        octets = fields.get(last) if desc == _OCTETS else None
        try:
            if octets is None:
                message = self._built(type_, fields, type_)
                return bytes(self._store.serialize_cdr(message, type_, little_endian=True))
            data = _array("uint8", octets, 0, f"{type_}.{last}")
            head = self.encode(type_, {name: each for name, each in fields.items() if name != last})
            return b"".join((head[:-4], len(data).to_bytes(4, "little"), data.data))  # a picture is copied once
        except RosTypeError:
            raise
        except (SerdeError, *_MISFITS) as error:
            raise RosTypeError(f"a value does not fit {type_}: {error}") from None

    def decode(self, type_: str, data: bytes | memoryview) -> Fields:
        """All fields of a message, arrays of numbers as those of numpy, without a copy; raises RosTypeError."""
        from rosbags.serde import SerdeError

        try:
            message = self._store.deserialize_cdr(data, self._known(type_))
        except (SerdeError, *_MISFITS) as error:
            raise RosTypeError(f"{len(data)} bytes are no {type_}: {error}") from None
        return self._plain(type_, message)

    def fields(self, type_: str) -> tuple[str, ...]:
        """The names of a type's fields; raises RosTypeError."""
        return tuple(name for name, _ in self._store.fielddefs[self._known(type_)][1])

    def has_header(self, type_: str) -> bool:
        """Whether a type has a stamp and a frame id."""
        return any(name == "header" and desc == (_NAME, HEADER) for name, desc in self._store.fielddefs[type_][1])

    def check_path(self, type_: str, path: str) -> None:
        """Raises RosTypeError where a type has no such path (``pose.pose.position.x``)."""
        at = self._known(type_)
        for name in path.split("."):
            known = dict(self._store.fielddefs[at][1]) if isinstance(at, str) else {}
            if name not in known:
                raise RosTypeError(
                    f"{type_} has no '{path}': there is no '{name}' among {', '.join(known) or 'no fields'}"
                )
            at = known[name][1]

    def _known(self, type_: str) -> str:
        if type_ not in self._store.fielddefs:
            import difflib

            close = difflib.get_close_matches(type_, self._store.fielddefs, 1)
            hint = f"did you mean '{close[0]}'?" if close else "expected package/msg/Name, or its file in 'messages:'"
            raise RosTypeError(f"the ROS type '{type_}' is not known: {hint}")
        return type_

    def _refuse_unknown_parts(self, type_: str) -> None:
        for name, desc in self._store.fielddefs[type_][1]:
            inner = desc[1][0] if desc[0] not in (_BASE, _NAME) else desc
            if inner[0] == _NAME and inner[1] not in self._store.fielddefs:
                raise RosTypeError(f"'{name}' of {type_} is of {inner[1]}, which is not known: name its file, too")

    def _built(self, type_: str, fields: Any, place: str) -> Any:
        known = self._store.fielddefs[type_][1]
        if not isinstance(fields, Mapping) or (fields.keys() - {name for name, _ in known}):
            raise RosTypeError(f"{place} is {fields!r:.60}, expected the fields {', '.join(name for name, _ in known)}")
        values = {
            self._python_name(name): self._value(desc, fields.get(name), f"{place}.{name}") for name, desc in known
        }
        return self._store.types[type_](**values)

    def _value(self, desc: Any, value: Any, place: str) -> Any:
        """A value as rosbags wants it; None is 0 or empty."""
        kind, of = desc
        if kind == _NAME:
            return self._built(of, {} if value is None else value, place)
        if kind == _BASE:
            return _scalar(of[0], value, place)
        (inner_kind, inner), count = of
        if inner_kind == _BASE and inner[0] not in _TEXTS:
            return _array(inner[0], value, count if kind == _ARRAY else 0, place)
        found = [None] * (count if kind == _ARRAY else 0) if value is None else value
        return [self._value((inner_kind, inner), each, f"{place}[{at}]") for at, each in enumerate(found)]

    def _plain(self, type_: str, message: Any) -> Fields:
        named = self._store.fielddefs[type_][1]
        return {name: self._plain_value(desc, getattr(message, self._python_name(name))) for name, desc in named}

    def _plain_value(self, desc: Any, value: Any) -> Any:
        kind, of = desc
        if kind == _NAME:
            return self._plain(of, value)
        if kind != _BASE and of[0][0] == _NAME:
            return [self._plain(of[0][1], each) for each in value]
        return value


def _definitions(path: Path) -> Mapping[str, Any]:
    from rosbags.typesys import TypesysError, get_types_from_idl, get_types_from_msg

    try:
        if path.stat().st_size > _LARGEST_DEFINITION:
            raise RosTypeError(f"{path} is larger than {_LARGEST_DEFINITION >> 20} MB, expected a type")
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise RosTypeError(f"{path}: {getattr(error, 'strerror', None) or 'not UTF-8'}") from None
    try:
        if path.suffix == ".idl":
            return dict(get_types_from_idl(text))
        return dict(get_types_from_msg(text, own_name(path)))
    except TypesysError as error:
        raise RosTypeError(f"{path}: {' '.join(str(error).split())}") from None


def own_name(path: Path) -> str:
    """The type of a ``.msg`` file: ``lane_msgs/msg/Lane`` for ``lane_msgs/msg/Lane.msg`` and ``lane_msgs/Lane.msg``."""
    folders = path.absolute().parent.parts
    package = folders[-2] if len(folders) > 1 and folders[-1] == "msg" else folders[-1]
    return f"{package}/msg/{path.stem}"


def _scalar(base: str, value: Any, place: str) -> Any:
    kinds: Any = str if base in _TEXTS else (bool, np.bool_) if base == "bool" else (int, float, np.number)
    if value is None:
        return "" if kinds is str else 0
    if not isinstance(value, kinds) or (isinstance(value, bool) and base != "bool"):
        raise RosTypeError(f"{place} is {value!r:.60}, expected {base}")
    if base.startswith(("int", "uint", "byte", "char")):
        limits = np.iinfo(_DTYPES.get(base, base))
        if not limits.min <= value <= limits.max or value != int(value):
            raise RosTypeError(f"{place} is {value!r}, expected a whole number from {limits.min} to {limits.max}")
        return int(value)
    return value


def _array(base: str, value: Any, count: int, place: str) -> Any:
    dtype = np.dtype(_DTYPES.get(base, base))
    if value is None:
        return np.zeros(count, dtype)
    try:
        found = np.frombuffer(value, dtype) if isinstance(value, bytes) else value
        return np.ascontiguousarray(found, dtype).reshape(-1)
    except (TypeError, ValueError, OverflowError):
        raise RosTypeError(f"{place} is {value!r:.60}, expected a list of {base}") from None
