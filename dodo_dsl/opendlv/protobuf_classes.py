"""Message classes of the protobuf package, made at run time from the definitions of an ``.odvd`` file."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from google.protobuf.message import Message

from dodo_dsl.opendlv.odvd import INTEGER_BITS, SCALARS, Definition, Field, OdvdError
from dodo_dsl.opendlv.wire import MAX_NESTING, Shape

MAX_FIELDS = 100_000

_Proto = descriptor_pb2.FieldDescriptorProto
_PROTO_TYPES: Mapping[str, "descriptor_pb2.FieldDescriptorProto.Type.ValueType"] = {
    **{each: getattr(_Proto, f"TYPE_{each.upper()}") for each in SCALARS - INTEGER_BITS.keys()},
    **dict.fromkeys(("char", "uint8", "uint16", "uint32"), _Proto.TYPE_UINT32),
    **dict.fromkeys(("int8", "int16", "int32"), _Proto.TYPE_SINT32),
    "uint64": _Proto.TYPE_UINT64,
    "int64": _Proto.TYPE_SINT64,
}
_FIXED_SIZE = frozenset({"bool", "float", "double"})


@dataclass(frozen=True)
class Layout:
    """A message class and what its codec needs to know.

    ``filled`` is the encoding of a message with nothing set, every field written; ``fixed_size`` its length where
    that never varies. ``narrow`` are the integers of less than 32 bits, ``texts`` the strings, ``inner`` the fields
    that are messages.
    """

    type: type[Message]
    definition: Definition
    filled: bytes
    fixed_size: int | None
    narrow: tuple[tuple[str, str], ...]
    texts: tuple[str, ...]
    inner: Mapping[str, "Layout"]
    shape: Shape


def build(definitions: Iterable[Definition]) -> dict[str, Layout]:
    """Layouts by full name; raises OdvdError for an unknown type, a message in itself, or clashing names."""
    builder = _Builder({d.name: d for d in definitions})
    for name in builder.definitions:
        builder.layout(name, depth=0)
    return builder.layouts


class _Builder:
    def __init__(self, definitions: dict[str, Definition]) -> None:
        self.definitions = definitions
        self.layouts: dict[str, Layout] = {}
        self._fields: dict[str, int] = {}
        """How many fields a message unfolds to: those of inner messages are counted as often as they occur."""
        self._pool = descriptor_pool.DescriptorPool()

    def layout(self, name: str, depth: int) -> Layout:
        if name in self.layouts:
            return self.layouts[name]
        definition = self.definitions[name]
        if depth > MAX_NESTING:
            raise OdvdError(f"{definition.place}: '{name}' nests messages without end or deeper than {MAX_NESTING}")
        inner = {
            field.name: self.layout(self._resolved(definition, field), depth + 1)
            for field in definition.fields
            if field.type not in SCALARS
        }
        self._fields[name] = 1 + sum(
            self._fields[inner[field.name].definition.name] if field.name in inner else 1 for field in definition.fields
        )
        if self._fields[name] > MAX_FIELDS:
            raise OdvdError(f"{definition.place}: '{name}' unfolds to more than {MAX_FIELDS} fields")
        self.layouts[name] = _layout(definition, inner, self._message_type(definition, inner))
        return self.layouts[name]

    def _resolved(self, definition: Definition, field: Field) -> str:
        names = f"{definition.package}.{field.type}", field.type
        if found := next((name for name in names if name in self.definitions), ""):
            return found
        raise OdvdError(f"{field.place}: '{field.type}' is neither a type nor a message")

    def _message_type(self, definition: Definition, inner: Mapping[str, Layout]) -> type[Message]:
        package, _, short_name = definition.name.rpartition(".")
        file = descriptor_pb2.FileDescriptorProto(name=definition.name, package=package, syntax="proto2")
        file.dependency.extend(sorted({layout.definition.name for layout in inner.values()}))
        message = file.message_type.add(name=short_name)
        for field in definition.fields:
            if hasattr(Message, field.name):
                raise OdvdError(f"{field.place}: the name '{field.name}' is protobuf's own, expected another")
            message.field.append(_field(field, inner))
        try:
            self._pool.AddSerializedFile(file.SerializeToString())
            return message_factory.GetMessageClass(self._pool.FindMessageTypeByName(definition.name))
        except (TypeError, KeyError) as error:
            raise OdvdError(f"{definition.place}: protobuf cannot hold '{definition.name}': {error}") from None


def _field(field: Field, inner: Mapping[str, Layout]) -> "descriptor_pb2.FieldDescriptorProto":
    proto = _Proto(name=field.name, json_name=field.name, number=field.number, label=_Proto.LABEL_OPTIONAL)
    if field.name in inner:
        proto.type, proto.type_name = _Proto.TYPE_MESSAGE, "." + inner[field.name].definition.name
        return proto
    proto.type = _PROTO_TYPES[field.type]
    if field.default is not None:
        text = str(field.default)
        proto.default_value = text.lower() if field.type == "bool" else text
    return proto


def _layout(definition: Definition, inner: Mapping[str, Layout], type_: type[Message]) -> Layout:
    fields, message = definition.fields, type_()
    for field in message.DESCRIPTOR.fields:
        if field.name in inner:
            getattr(message, field.name).MergeFromString(inner[field.name].filled)
        else:
            setattr(message, field.name, field.default_value)
    filled = message.SerializeToString()
    return Layout(
        type=type_,
        definition=definition,
        filled=filled,
        fixed_size=len(filled) if all(field.type in _FIXED_SIZE for field in fields) else None,
        narrow=tuple((f.name, f.type) for f in fields if INTEGER_BITS.get(f.type, 32) < 32),
        texts=tuple(field.name for field in fields if field.type == "string"),
        inner=inner,
        shape={f.number: inner[f.name].shape if f.name in inner else {} for f in fields},
    )
