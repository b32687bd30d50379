"""The field types of message specifications, their ranges, and their default values."""

import re

from dodo_dsl.opendlv.odvd.tokens import OdvdError, Token

INTEGER_BITS = {
    "char": 8,
    "uint8": 8,
    "int8": 8,
    "uint16": 16,
    "int16": 16,
    "uint32": 32,
    "int32": 32,
    "uint64": 64,
    "int64": 64,
}
SCALARS = frozenset(INTEGER_BITS) | {"bool", "float", "double", "string", "bytes"}

Default = bool | int | float | str | None


def integer_range(type_: str) -> range:
    """The values that an integer type holds; a ``char`` is 0 to 255."""
    bits = INTEGER_BITS[type_]
    return range(-(2 ** (bits - 1)), 2 ** (bits - 1)) if type_.startswith("int") else range(2**bits)


def default_of(type_: str, token: Token) -> Default:
    value = _value(type_, token)
    if value is None:
        raise OdvdError(f"{token.place}: {token} is not a default for a field of type '{type_}'")
    return value


def _value(type_: str, token: Token) -> Default:
    if type_ == "bool":
        return {"true": True, "false": False}.get(token.text) if token.kind == "name" else None
    if type_ in ("float", "double"):
        return float(token.text) if token.kind == "number" else None
    if type_ in ("string", "bytes"):
        return token.text if token.kind == "string" else None
    if type_ == "char" and token.kind == "char":
        return ord(token.text) if ord(token.text) in integer_range(type_) else None
    if type_ in INTEGER_BITS and token.kind == "number" and re.fullmatch(r"[+-]?[0-9]{1,20}", token.text):
        return int(token.text) if int(token.text) in integer_range(type_) else None
    return None
