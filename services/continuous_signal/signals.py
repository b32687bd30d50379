"""A signal: a field of a message."""

import difflib
from dataclasses import dataclass
from typing import Any

from google.protobuf.descriptor import FieldDescriptor

from dodo_dsl.opendlv.messages.message_set import MessageSet

_NO_NUMBERS = (FieldDescriptor.CPPTYPE_STRING, FieldDescriptor.CPPTYPE_MESSAGE)


@dataclass(frozen=True)
class Signal:
    """A number in a message: the message's full name, its sender stamp, and the field."""

    message: str
    sender: int
    field: str

    def value(self, message: Any) -> float:
        """The number that a message carries."""
        return float(getattr(message, self.field))

    def __str__(self) -> str:
        return f"{self.message}/{self.sender}"


def check(signal: Signal, messages: MessageSet) -> Signal:
    """The signal itself; raises UnknownMessage, and ValueError for a field that is unknown or not a number."""
    fields = {field.name: field for field in messages.type(signal.message).DESCRIPTOR.fields}
    field = fields.get(signal.field)
    if field is None:
        close = difflib.get_close_matches(signal.field, fields, n=1)
        hint = f"did you mean '{close[0]}'?" if close else f"it has {', '.join(fields) or 'none'}"
        raise ValueError(f"{signal.message} has no field '{signal.field}'; {hint}")
    if field.cpp_type in _NO_NUMBERS:
        raise ValueError(f"the field {signal.field} of {signal.message} is not a number")
    return signal
