"""A parameter's value as written in a spec, converted to the value of the service's flag."""

import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from decimal import Decimal
from pathlib import Path
from typing import Literal

from dodo_dsl.diagnostics import Diagnostic, Fix, Span, did_you_mean, only_fix
from dodo_dsl.source import Mapping, Node, Scalar, Sequence, path_of, resolve
from dodo_dsl.spec import quantity
from dodo_dsl.spec.manifest import Parameter
from dodo_dsl.spec.slips import boolean_meant, repaired

Kind = Literal["text", "path", "memory"]

_MEMORY = re.compile(r"/?[A-Za-z0-9][A-Za-z0-9._-]{0,99}")
_MESSAGE = re.compile(r"[A-Za-z_]\w*(\.[A-Za-z_]\w*)*", re.ASCII)
_OUTPUT = re.compile(r"(/tmp/)?[A-Za-z0-9][A-Za-z0-9._-]{0,99}")
_MAX_TEXT = 4096


@dataclass(frozen=True)
class Value:
    """A flag's value: a string, the absolute path of a file of the registry, or a shared memory's name."""

    text: str
    kind: Kind = "text"
    path: Path | None = None


class ValueProblem(Exception):
    """A written value does not fit its parameter."""

    def __init__(self, span: Span, rule: str, message: str, hint: str = "", fix: Fix | None = None) -> None:
        super().__init__(message)
        self.diagnostic = Diagnostic(span, rule, message, hint, fix=fix)


def convert(parameter: Parameter, node: Node, root: Path) -> Value:
    """The flag's value; raises ValueProblem if a value does not fit. Paths stay below ``root``."""
    return _CONVERTERS[parameter.type](parameter, node, root)


def default_value(parameter: Parameter) -> Value | None:
    """The manifest's default as the flag's value."""
    default = parameter.default
    if default is None:
        return None
    kind: Kind = "memory" if parameter.type == "memory" else "text"
    if isinstance(default, bool):
        return Value("true" if default else "false")
    if isinstance(default, list):
        return Value(",".join(str(item) for item in default))
    if isinstance(default, int | float):
        return Value(quantity.decimal_text(Decimal(str(default))))
    return Value(str(default), kind)


def _name(parameter: Parameter) -> str:
    return f"parameter '{parameter.name}'"


def _scalar(parameter: Parameter, node: Node, expected: str) -> Scalar:
    if not isinstance(node, Scalar) or node.value is None:
        found = (
            "is empty" if isinstance(node, Scalar) else "is a list" if isinstance(node, Sequence) else "is a mapping"
        )
        raise ValueProblem(node.span, "wrong-type", f"{_name(parameter)} {found}, expected {expected}")
    return node


def _number(parameter: Parameter, node: Node, _: Path) -> Value:
    expected = f"a quantity in {parameter.unit}" if parameter.unit else "a number"
    scalar = _scalar(parameter, node, expected)
    if parameter.unit:
        try:
            number = quantity.convert(scalar.text, parameter.unit)
        except quantity.QuantityError as error:
            message = f"{_name(parameter)}: {error}"
            raise ValueProblem(scalar.span, "wrong-unit", message, error.hint, error.fix) from error
    else:
        number = _bare_number(parameter, scalar)
    return _bounded(parameter, scalar, number)


def _amount(parameter: Parameter, node: Node, _: Path) -> Value:
    """A bare number or a quantity, in the base unit of its dimension; where allowed, a share such as ``25%``."""
    scalar = _scalar(parameter, node, "a number or a quantity")
    try:
        if parameter.or_share and quantity.written_unit(scalar.text) == "%":
            share = quantity.convert(scalar.text, quantity.SHARE)
            return Value(f"{_bounded(parameter, scalar, share * 100).text}%")
        return _bounded(parameter, scalar, quantity.in_base_unit(scalar.text))
    except quantity.QuantityError as error:
        raise ValueProblem(scalar.span, "wrong-unit", f"{_name(parameter)}: {error}", error.hint) from error


def _bare_number(parameter: Parameter, scalar: Scalar) -> Decimal:
    whole = parameter.type == "integer"
    wanted: type | tuple[type, ...] = int if whole else (int, float)
    if isinstance(scalar.value, bool) or not isinstance(scalar.value, wanted):
        expected = "a whole number" if whole else "a number"
        rule = "wrong-unit" if re.match(r"[-+.]*\d[.\d]*\s*[A-Za-z%]", scalar.text) else "wrong-type"
        message = f"{_name(parameter)} is '{scalar.text}', expected {expected} without a unit"
        hint, fix = repaired(scalar.text, lambda text: type(resolve(text.strip())) in (int, float))
        raise ValueProblem(scalar.span, rule, message, hint, fix)
    number = Decimal(str(scalar.value))
    if not number.is_finite():
        raise ValueProblem(
            scalar.span, "wrong-type", f"{_name(parameter)} is '{scalar.text}', expected a finite number"
        )
    return number


def _bounded(parameter: Parameter, scalar: Scalar, number: Decimal) -> Value:
    low, high = parameter.minimum, parameter.maximum
    if (low is not None and number < Decimal(str(low))) or (high is not None and number > Decimal(str(high))):
        unit = f" {parameter.unit}" if parameter.unit not in ("", quantity.SHARE) else ""
        if low is not None and high is not None:
            expected = f"{low:g} to {high:g}{unit}"
        else:
            expected = f"at least {low:g}{unit}" if low is not None else f"at most {high:g}{unit}"
        is_percent = parameter.unit == quantity.SHARE and high == 1 and 1 < number <= 100 and "%" not in scalar.text
        hint = f"write '{scalar.text} %'" if is_percent else ""
        message = f"{_name(parameter)} is {scalar.text}, expected {expected}"
        raise ValueProblem(scalar.span, "out-of-range", message, hint)
    return Value(quantity.decimal_text(number))


def _text(parameter: Parameter, node: Node, _: Path) -> Value:
    scalar = _scalar(parameter, node, "a string")
    _check_text(parameter, scalar)
    if parameter.choices and scalar.text not in parameter.choices:
        message = f"{_name(parameter)} is '{scalar.text}', expected one of {', '.join(parameter.choices)}"
        hint, fix = did_you_mean(scalar.text, parameter.choices), only_fix(scalar.text, parameter.choices)
        raise ValueProblem(scalar.span, "wrong-value", message, hint, fix)
    return Value(scalar.text)


def _check_text(parameter: Parameter, scalar: Scalar) -> None:
    if len(scalar.text) > _MAX_TEXT or not scalar.text.isprintable():
        message = f"{_name(parameter)} has control characters or is longer than {_MAX_TEXT} characters"
        raise ValueProblem(scalar.span, "wrong-value", message)


def _boolean(parameter: Parameter, node: Node, _: Path) -> Value:
    scalar = _scalar(parameter, node, "true or false")
    if not isinstance(scalar.value, bool):
        message = f"{_name(parameter)} is '{scalar.text}', expected true or false"
        raise ValueProblem(scalar.span, "wrong-type", message, *boolean_meant(scalar.text))
    return Value("true" if scalar.value else "false")


def _memory(parameter: Parameter, node: Node, _: Path) -> Value:
    scalar = _scalar(parameter, node, "a shared memory's name")
    if not _MEMORY.fullmatch(scalar.text):
        message = f"{_name(parameter)} is '{scalar.text}', expected a shared memory's name such as video0.argb"
        raise ValueProblem(scalar.span, "wrong-value", message)
    return Value(scalar.text, "memory")


def _message(parameter: Parameter, node: Node, _: Path) -> Value:
    scalar = _scalar(parameter, node, "a message's name")
    if not _MESSAGE.fullmatch(scalar.text):
        message = f"{_name(parameter)} is '{scalar.text[:60]}', expected a message's full name"
        hint = "for example opendlv.proxy.GroundSteeringRequest"
        raise ValueProblem(scalar.span, "wrong-value", message, hint)
    return Value(scalar.text)


def _output(parameter: Parameter, node: Node, _: Path) -> Value:
    scalar = _scalar(parameter, node, "a file's name")
    if not _OUTPUT.fullmatch(scalar.text):
        message = f"{_name(parameter)} is '{scalar.text[:60]}', expected a file's name without a folder, or one in /tmp"
        raise ValueProblem(scalar.span, "path-escape", message)
    return Value(scalar.text)


def _list(parameter: Parameter, node: Node, root: Path) -> Value:
    items = node.items if isinstance(node, Sequence) else (node,)
    if isinstance(node, Mapping):
        hint = f"write [{', '.join(node.entries)}]"
        raise ValueProblem(node.span, "wrong-type", f"{_name(parameter)} is a mapping, expected a list", hint)
    if parameter.of:
        return Value(",".join(_number(replace(parameter, type=parameter.of), item, root).text for item in items))
    texts = []
    for item in items:
        text = _text(parameter, item, root).text
        if "," in text:
            message = f"{_name(parameter)}: '{text}' must not contain a comma"
            raise ValueProblem(item.span, "wrong-value", message, "write two items: [left, right]")
        texts.append(text)
    return Value(",".join(texts))


def _path(parameter: Parameter, node: Node, root: Path) -> Value:
    scalar = _scalar(parameter, node, "a path relative to the spec")
    _check_text(parameter, scalar)
    folder = Path(scalar.span.file).parent
    if not scalar.text or Path(scalar.text).is_absolute():
        message = f"{_name(parameter)} is '{scalar.text}', expected a path relative to the spec"
        raise ValueProblem(scalar.span, "path-escape", message)
    target = path_of(folder, scalar.text)
    if target is None:
        message = f"{_name(parameter)}: '{scalar.text[:60]}' is too long for a path, or a symlink loop"
        raise ValueProblem(scalar.span, "missing-file", message)
    if not target.is_relative_to(root.resolve()):
        message = f"{_name(parameter)}: '{scalar.text}' leaves the registry"
        raise ValueProblem(
            scalar.span,
            "path-escape",
            message,
            "the files of a test must be in its registry: copy them there",
        )
    if not target.exists():
        beside = [p.name for p in target.parent.iterdir()] if target.parent.is_dir() else []
        message = f"{_name(parameter)}: there is no file or folder '{scalar.text}'"
        raise ValueProblem(scalar.span, "missing-file", message, did_you_mean(target.name, beside))
    if not target.is_file() and not target.is_dir():
        message = f"{_name(parameter)}: '{scalar.text}' is a pipe or a device, expected a file or a folder"
        raise ValueProblem(scalar.span, "unreadable-file", message)
    return Value(scalar.text, "path", target)


_CONVERTERS: dict[str, Callable[[Parameter, Node, Path], Value]] = {
    "number": _number,
    "integer": _number,
    "amount": _amount,
    "string": _text,
    "boolean": _boolean,
    "path": _path,
    "memory": _memory,
    "message": _message,
    "list": _list,
    "output": _output,
}
