"""The arguments of a test's services: the value of each parameter as its flag carries it, and where it comes from."""

import functools
import re
from collections.abc import Callable
from collections.abc import Mapping as Map
from dataclasses import dataclass, replace
from decimal import Decimal
from pathlib import Path
from typing import Literal

from dodo_dsl.diagnostics import Diagnostic, did_you_mean
from dodo_dsl.opendlv.assets import map_file
from dodo_dsl.source import Entry, Mapping, Node, Scalar, Sequence, path_of, walk
from dodo_dsl.spec import quantity
from dodo_dsl.spec.manifest import FRAMES, Manifest, Parameter, Ports, holds
from dodo_dsl.spec.model import Spec, Use
from dodo_dsl.spec.registry import near_path
from dodo_dsl.spec.rig import Rig
from dodo_dsl.spec.slips import boolean_meant

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

    def __init__(self, parameter: Parameter, node: Node, rule: str, text: str, hint: str = "") -> None:
        message = f"parameter '{parameter.name}'{text}"
        super().__init__(message)
        self.diagnostic = Diagnostic(node.span, rule, message, hint)


def convert(parameter: Parameter, node: Node, root: Path) -> Value:
    """The flag's value; raises ValueProblem if a value does not fit. Paths stay below ``root``."""
    return _CONVERTERS[parameter.type](parameter, node, root)


def default_value(parameter: Parameter) -> Value | None:
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
        raise ValueProblem(parameter, node, "wrong-unit", f": {error}", error.hint) from error
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
    raise ValueProblem(parameter, scalar, rule, f" is '{scalar.text}', expected {expected} without a unit")


def _bounded(parameter: Parameter, scalar: Scalar, number: Decimal) -> Value:
    low, high = parameter.minimum, parameter.maximum
    if (low is None or number >= Decimal(str(low))) and (high is None or number <= Decimal(str(high))):
        if parameter.multiple_of > 1 and number % parameter.multiple_of:
            text = f" is {scalar.text}, expected a multiple of {parameter.multiple_of}"
            raise ValueProblem(parameter, scalar, "out-of-range", text, f"write for example {int(number) - 1}")
        return Value(quantity.decimal_text(number))
    is_percent = parameter.unit == quantity.SHARE and high == 1 and 1 < number <= 100 and "%" not in scalar.text
    hint = f"write '{scalar.text} %'" if is_percent else ""
    raise ValueProblem(parameter, scalar, "out-of-range", f" is {scalar.text}, expected {parameter.bounds}", hint)


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
        raise ValueProblem(parameter, node, "wrong-value", text, did_you_mean(scalar.text, parameter.choices))
    return Value(scalar.text, "memory" if parameter.type == "memory" else "text")


def _boolean(parameter: Parameter, node: Node, _: Path) -> Value:
    scalar = _scalar(parameter, node, "true or false")
    if not isinstance(scalar.value, bool):
        text = f" is '{scalar.text}', expected true or false"
        raise ValueProblem(parameter, node, "wrong-type", text, boolean_meant(scalar.text))
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
        hint = near_path(text, folder, root)
        raise ValueProblem(parameter, node, "missing-file", f": there is no file or folder '{text}'", hint)
    if not target.is_file() and not target.is_dir():
        what = f": '{text}' is a pipe or a device, expected a file or a folder"
        raise ValueProblem(parameter, node, "unreadable-file", what)
    return Value(text, "path", target)


_CONVERTERS: dict[str, Callable[[Parameter, Node, Path], Value]] = {
    **dict.fromkeys(("number", "integer", "amount"), _number),
    **dict.fromkeys(("string", "memory", "message", "output"), _text),
    "boolean": _boolean,
    "path": _path,
    "list": _list,
}


FRAME = "opendlv.sim.Frame"


@dataclass(frozen=True)
class Argument:
    """A parameter's value as its flag carries it, converted once.

    ``entry`` is where it is written, None for the manifest's default. ``value`` is None when there is no value, when
    the written one does not fit, which ``problem`` then describes, and when it has no effect beside other parameters.
    """

    parameter: Parameter
    entry: Entry | None = None
    value: Value | None = None
    problem: Diagnostic | None = None

    @property
    def text(self) -> str | None:
        return self.value.text if self.value else None


@dataclass(frozen=True)
class ResolvedService:
    """A service of a test with its manifest and the arguments of all its parameters, by name."""

    use: Use
    manifest: Manifest
    arguments: Map[str, Argument]

    @functools.cached_property
    def messages(self) -> Ports:
        return self.manifest.messages_with(self.texts)

    @functools.cached_property
    def texts(self) -> Map[str, str]:
        """The values as strings; parameters without a fitting value are missing."""
        return {name: a.value.text for name, a in self.arguments.items() if a.value is not None}

    @property
    def ends_input(self) -> bool:
        """Whether it ends the input of its test, as a recording does that is not repeated, and the end of a path."""
        texts = self.texts
        has_end = any(texts.get(name) for name in ("path", "points", "length")) and texts.get("hold") == "false"
        return self.use.layer != "evaluation" and (has_end or texts.get("autorewind") == "false")

    def filling(self, placeholder: str) -> str | None:
        """What stands for a placeholder of the manifest's ports; None if its parameter has no fitting value.

        Of the frames at which a map has models, that of ``frame-id`` is the service's own vehicle.
        """
        frames = FRAMES.fullmatch(placeholder)
        if placeholder in self.arguments or frames is None:
            return self.texts.get(placeholder)
        argument = self.arguments.get(frames["map"])
        path = argument.value.path if argument and argument.value else None
        if path is None:
            return None
        stamps = map(str, map_file.read_frames(path))
        return ",".join(f"{FRAME}/{stamp}" for stamp in stamps if stamp != self.texts.get("frame-id")) or None


def written(spec: Spec, use: Use, parameter: Parameter, rig: Rig | None) -> Entry | None:
    """The entry that sets a parameter: in its service, in another service that shares it, or in the rig."""
    own = use.parameters.get(parameter.name)
    if own is not None:
        return own
    if parameter.shared:
        for other in spec.uses:
            is_meant = parameter.shared in (True, other.uses.text)
            if is_meant and other is not use and parameter.name in other.parameters:
                return other.parameters[parameter.name]
    return rig.entry(parameter.rig) if rig and parameter.rig else None


Known = dict[tuple[int, int, Path], Argument]
"""Arguments of instances by the parameter, its entry (what they hold keeps both) and the registry."""


def _argument(parameter: Parameter, entry: Entry | None, root: Path, known: Known) -> Argument:
    """The argument of one parameter, the default included; instances share what they share in their spec."""
    key = id(parameter), id(entry), root
    if key not in known:
        known[key] = _converted(parameter, entry, root)
    return known[key]


def _converted(parameter: Parameter, entry: Entry | None, root: Path) -> Argument:
    if entry is None:
        return Argument(parameter, None, default_value(parameter))
    if any(node.tag for node in walk(entry.value)):
        return Argument(parameter, entry)  # which is a problem of its own
    try:
        return Argument(parameter, entry, convert(parameter, entry.value, root))
    except ValueProblem as problem:
        return Argument(parameter, entry, None, problem.diagnostic)


def resolved(spec: Spec, use: Use, manifest: Manifest, rig: Rig | None, known: Known) -> ResolvedService:
    """A service with all its arguments; parameters without an effect beside others have no value."""
    arguments: dict[str, Argument] = {}
    texts: dict[str, str] = {}
    for name, parameter in sorted(manifest.parameters.items(), key=lambda item: bool(item[1].when)):
        has_effect = holds(parameter.when, texts)
        found = _argument(parameter, written(spec, use, parameter, rig), spec.location.root, known)
        arguments[name] = found if has_effect else Argument(parameter, found.entry)
        if has_effect and found.value is not None:
            texts[name] = found.value.text
    return ResolvedService(use, manifest, {name: arguments[name] for name in manifest.parameters})
