"""A parameter's value as written in a spec, converted to the value of the service's flag."""

import os
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from decimal import Decimal
from pathlib import Path
from typing import Literal

from dodo_dsl.diagnostics import Diagnostic, Fix, closest, did_you_mean, only_fix, shown_path
from dodo_dsl.source import Mapping, Node, Scalar, Sequence, path_of, resolve
from dodo_dsl.spec import quantity
from dodo_dsl.spec.manifest import Parameter
from dodo_dsl.spec.slips import boolean_meant, repaired

Kind = Literal["text", "path", "memory"]

_MAX_TEXT = 4096
_TEXTS = {
    "memory": (r"/?[A-Za-z0-9][A-Za-z0-9._-]{0,99}", "wrong-value", "a shared memory's name such as video0.argb"),
    "message": (
        r"[A-Za-z_]\w*(\.[A-Za-z_]\w*)*",
        "wrong-value",
        "a message's full name such as opendlv.proxy.GroundSteeringRequest",
    ),
    "output": (
        r"(/tmp/)?[A-Za-z0-9][A-Za-z0-9._-]{0,99}",
        "path-escape",
        "a file's name without a folder, or one in /tmp",
    ),
}
"""What texts of these types look like, the rule about others, and in words what is expected."""


@dataclass(frozen=True)
class Value:
    """A flag's value: a string, the absolute path of a file of the registry, or a shared memory's name."""

    text: str
    kind: Kind = "text"
    path: Path | None = None


class ValueProblem(Exception):
    """A written value does not fit its parameter."""

    def __init__(
        self, parameter: Parameter, node: Node, rule: str, text: str, hint: str = "", fix: Fix | None = None
    ) -> None:
        message = f"parameter '{parameter.name}'{text}"
        super().__init__(message)
        self.diagnostic = Diagnostic(node.span, rule, message, hint, fix=fix)


def convert(parameter: Parameter, node: Node, root: Path) -> Value:
    """The flag's value; raises ValueProblem if a value does not fit. Paths stay below ``root``."""
    return _CONVERTERS[parameter.type](parameter, node, root)


def default_value(parameter: Parameter) -> Value | None:
    """The manifest's default as the flag's value."""
    default = parameter.default
    if default is None:
        return None
    if isinstance(default, bool):
        return Value("true" if default else "false")
    if isinstance(default, list):
        return Value(",".join(str(item) for item in default))
    if isinstance(default, int | float):
        return Value(quantity.decimal_text(Decimal(str(default))))
    return Value(str(default), "memory" if parameter.type == "memory" else "text")


def _scalar(parameter: Parameter, node: Node, expected: str) -> Scalar:
    if not isinstance(node, Scalar) or node.value is None:
        found = {Scalar: "empty", Sequence: "a list", Mapping: "a mapping"}[type(node)]
        raise ValueProblem(parameter, node, "wrong-type", f" is {found}, expected {expected}")
    return node


def _number(parameter: Parameter, node: Node, _: Path) -> Value:
    scalar = _scalar(parameter, node, f"a quantity in {parameter.unit}" if parameter.unit else "a number")
    try:
        if parameter.unit:
            number = quantity.convert(scalar.text, parameter.unit)
        elif parameter.type != "amount":
            number = _bare_number(parameter, scalar)
        elif parameter.or_share and quantity.written_unit(scalar.text) == "%":
            share = quantity.convert(scalar.text, quantity.SHARE)
            return Value(f"{_bounded(parameter, scalar, share * 100).text}%")
        else:  # in the base unit of its dimension
            number = quantity.in_base_unit(scalar.text)
    except quantity.QuantityError as error:
        raise ValueProblem(parameter, node, "wrong-unit", f": {error}", error.hint, error.fix) from error
    return _bounded(parameter, scalar, number)


def _bare_number(parameter: Parameter, scalar: Scalar) -> Decimal:
    is_whole = parameter.type == "integer"
    value = scalar.value
    if isinstance(value, int if is_whole else int | float) and not isinstance(value, bool):
        number = Decimal(str(value))
        if number.is_finite():
            return number
    expected = "a whole number" if is_whole else "a finite number"
    rule = "wrong-unit" if re.match(r"[-+.]*\d[.\d]*\s*[A-Za-z%]", scalar.text) else "wrong-type"
    hint, fix = repaired(scalar.text, lambda text: type(resolve(text.strip())) in (int, float))
    raise ValueProblem(parameter, scalar, rule, f" is '{scalar.text}', expected {expected} without a unit", hint, fix)


def _bounded(parameter: Parameter, scalar: Scalar, number: Decimal) -> Value:
    low, high = parameter.minimum, parameter.maximum
    if (low is None or number >= Decimal(str(low))) and (high is None or number <= Decimal(str(high))):
        return Value(quantity.decimal_text(number))
    unit = f" {parameter.unit}" if parameter.unit not in ("", quantity.SHARE) else ""
    if low is not None and high is not None:
        expected = f"{low:g} to {high:g}{unit}"
    else:
        expected = f"at least {low:g}{unit}" if low is not None else f"at most {high:g}{unit}"
    is_percent = parameter.unit == quantity.SHARE and high == 1 and 1 < number <= 100 and "%" not in scalar.text
    hint = f"write '{scalar.text} %'" if is_percent else ""
    raise ValueProblem(parameter, scalar, "out-of-range", f" is {scalar.text}, expected {expected}", hint)


def _text(parameter: Parameter, node: Node, _: Path) -> Value:
    pattern, rule, expected = _TEXTS.get(parameter.type, (".*", "wrong-value", "a string"))
    scalar = _scalar(parameter, node, expected)
    if len(scalar.text) > _MAX_TEXT or not scalar.text.isprintable():
        text = f" has control characters or is longer than {_MAX_TEXT} characters"
        raise ValueProblem(parameter, node, "wrong-value", text)
    if not re.fullmatch(pattern, scalar.text, re.ASCII):
        raise ValueProblem(parameter, node, rule, f" is '{scalar.text[:60]}', expected {expected}")
    if parameter.choices and scalar.text not in parameter.choices:
        text = f" is '{scalar.text}', expected one of {', '.join(parameter.choices)}"
        hint, fix = did_you_mean(scalar.text, parameter.choices), only_fix(scalar.text, parameter.choices)
        raise ValueProblem(parameter, node, "wrong-value", text, hint, fix)
    return Value(scalar.text, "memory" if parameter.type == "memory" else "text")


def _boolean(parameter: Parameter, node: Node, _: Path) -> Value:
    scalar = _scalar(parameter, node, "true or false")
    if not isinstance(scalar.value, bool):
        text = f" is '{scalar.text}', expected true or false"
        raise ValueProblem(parameter, node, "wrong-type", text, *boolean_meant(scalar.text))
    return Value("true" if scalar.value else "false")


def _list(parameter: Parameter, node: Node, root: Path) -> Value:
    if isinstance(node, Mapping):
        hint = f"write [{', '.join(node.entries)}]"
        raise ValueProblem(parameter, node, "wrong-type", " is a mapping, expected a list", hint)
    item_type = replace(parameter, type=parameter.of or "string")
    texts = []
    for item in node.items if isinstance(node, Sequence) else (node,):
        text = convert(item_type, item, root).text
        if "," in text:
            hint = "write two items: [left, right]"
            raise ValueProblem(parameter, item, "wrong-value", f": '{text}' must not contain a comma", hint)
        texts.append(text)
    return Value(",".join(texts))


def _path(parameter: Parameter, node: Node, root: Path) -> Value:
    text = _text(parameter, _scalar(parameter, node, "a path relative to the spec"), root).text
    folder = Path(node.span.file).parent
    if not text or Path(text).is_absolute():
        raise ValueProblem(parameter, node, "path-escape", f" is '{text}', expected a path relative to the spec")
    target = path_of(folder, text)
    if target is None:
        what = f": '{text[:60]}' is too long for a path, or a symlink loop"
        raise ValueProblem(parameter, node, "missing-file", what)
    if not target.is_relative_to(root.resolve()):
        hint = "the files of a test must be in its registry: copy them there"
        raise ValueProblem(parameter, node, "path-escape", f": '{text}' leaves the registry", hint)
    if not target.exists():
        near = next(_near(text, target, folder, root.resolve()), "")
        hint = f"DoDo looked in {shown_path(str(target.parent))}" + (f"; did you mean '{near}'?" if near else "")
        fix = Fix(text, near) if near else None
        raise ValueProblem(parameter, node, "missing-file", f": there is no file or folder '{text}'", hint, fix)
    if not target.is_file() and not target.is_dir():
        what = f": '{text}' is a pipe or a device, expected a file or a folder"
        raise ValueProblem(parameter, node, "unreadable-file", what)
    return Value(text, "path", target)


def _near(text: str, target: Path, folder: Path, root: Path) -> Iterator[str]:
    """Paths like one that does not exist: of a like name beside it, or the same from a folder above."""
    beside = [path.name for path in target.parent.iterdir()] if target.parent.is_dir() else []
    for name in closest(target.name, beside):
        yield Path(os.path.relpath(target.parent / name, folder)).as_posix()
    for above in ("..", "../.."):
        path = (folder / above / text).resolve()
        if path.exists() and path.is_relative_to(root):
            yield f"{above}/{text}"


_CONVERTERS: dict[str, Callable[[Parameter, Node, Path], Value]] = {
    **dict.fromkeys(("number", "integer", "amount"), _number),
    **dict.fromkeys(("string", "memory", "message", "output"), _text),
    "boolean": _boolean,
    "path": _path,
    "list": _list,
}
