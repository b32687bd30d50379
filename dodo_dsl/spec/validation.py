"""JSON Schema errors as diagnostics at the line and column of their value."""

import functools
import itertools
import json
import math
import re
from collections.abc import Callable, Iterable, Iterator
from pathlib import PurePath
from typing import Any

import yaml

from dodo_dsl import __version__
from dodo_dsl.diagnostics import Diagnostic, Fix, Span, closest, did_you_mean, only_fix, shown_path
from dodo_dsl.source import MAX_PROBLEMS, Entry, Mapping, Node, Scalar, Sequence, plain, resolve
from dodo_dsl.spec import quantity
from dodo_dsl.spec.registry import SUFFIX, as_file
from dodo_dsl.spec.schema_errors import (
    OF_COMPOSE,
    UNIT,
    WORDS,
    check_quantity,
    is_valid,
    is_whole,
    schema_of,
    unindented,
    without_consequences,
)
from dodo_dsl.spec.slips import boolean_meant, slip_in_key

_HINT = "x-hint"
_PAIRS = tuple(f" of '{key}'" for key in ("environment", "labels", "args", "sysctls"))
"""What items of a list with NAME=value are called."""
_TYPE_NAMES = {
    "object": "a mapping (key: value)",
    "array": "a list",
    "string": "a string",
    "integer": "a whole number",
    "number": "a number",
    "boolean": "true or false",
    "null": "no value",
}


@functools.cache
def _validator(name: str) -> Any:
    from jsonschema import Draft202012Validator, ValidationError
    from jsonschema.validators import extend

    def is_quantity(_: Any, unit: str, instance: object, schema: dict[str, Any]) -> Iterator[Any]:
        try:
            check_quantity(unit, instance, schema)
        except quantity.QuantityError as error:
            yield ValidationError(str(error))

    valid: set[tuple[int, str]] = set()

    def properties(validator: Any, known: dict[str, Any], instance: Any, _: Any) -> Iterator[Any]:
        """The keyword ``properties``; a value that was valid once is not looked at again, as instances have many."""
        for key, schema in known.items() if isinstance(instance, dict) else ():
            if key in instance and (known_as := (id(schema), repr(instance[key]))) not in valid:
                error = None
                for error in validator.descend(instance[key], schema, path=key, schema_path=key):
                    yield error
                if error is None:
                    valid.add(known_as)

    checker = Draft202012Validator.TYPE_CHECKER
    if name != OF_COMPOSE:
        checker = checker.redefine("integer", is_whole)
    keywords = {
        UNIT: is_quantity,
        "properties": properties,
        "required": _required_keys,
        "dependentRequired": _companions,
    }
    return extend(Draft202012Validator, keywords, type_checker=checker)(schema_of(name))  # type: ignore[no-untyped-call]


def _required_keys(_: Any, names: list[str], instance: Any, __: Any) -> Iterator[Any]:
    """The keyword ``required``, with an error a key, whose ``validator_value`` is that key alone."""
    from jsonschema import ValidationError

    for name in names if isinstance(instance, dict) else ():
        if name not in instance:
            yield ValidationError(f"{name!r} is missing", validator_value=name)


def _companions(_: Any, needed: dict[str, list[str]], instance: Any, __: Any) -> Iterator[Any]:
    """The keyword ``dependentRequired``, with an error a key; its ``validator_value`` is what that stands without."""
    from jsonschema import ValidationError

    for name, others in needed.items() if isinstance(instance, dict) else ():
        for other in others if name in instance else ():
            if other not in instance:
                yield ValidationError(f"{name!r} without {other!r}", validator_value=(name, other))


def validate(node: Node, schema: str) -> list[Diagnostic]:
    """All violations of ``schemas/<schema>.schema.json``; tags are refused as well."""
    found, document = list(_tags(node)), plain(node)
    if is_valid(document, schema):
        return found
    validator = _validator(schema)
    errors = itertools.islice(validator.iter_errors(document), MAX_PROBLEMS)
    for error in without_consequences(error for error in errors if not _is_of_rules(error)):
        place = _locate(node, error.absolute_path)
        place.is_of_file = len(error.absolute_path) == 1
        place.fits = validator.evolve(schema=error.schema).is_valid
        if not error.absolute_path:
            place.about = validator.schema.get("properties", {})
        found.extend(_TRANSLATORS.get(error.validator, _fallback)(error, place))
    return found


def _is_of_rules(error: Any) -> bool:
    """Whether a rule says more: which type and unit a parameter's value has."""
    path = error.absolute_path
    return (
        error.validator == "type" and len(path) == 4 and path[2] == "with" and isinstance(error.instance, dict | None)
    )


def _tags(node: Node) -> Iterator[Diagnostic]:
    if node.tag:
        tag = node.tag.replace("tag:yaml.org,2002:", "!!")
        yield Diagnostic(
            node.span, "yaml-tag", f"tag '{tag}' is not supported", "remove the tag, or write a text in quotes"
        )
    if isinstance(node, Mapping):
        for entry in node.entries.values():
            yield from _tags(entry.value)
    elif isinstance(node, Sequence):
        for item in node.items:
            yield from _tags(item)


class _Place:
    """A node with the span to report: its own, or its key's where the value is a collection."""

    def __init__(self, node: Node, key: Span | None, name: str) -> None:
        self.node = node
        self.span = node.span if isinstance(node, Scalar) and node.text else key or node.span
        self.name = name
        self.is_of_file = False
        """Whether it is the file's own key."""
        self.about: dict[str, Any] = {}
        self.fits: Callable[[object], bool] = lambda _: True
        """Whether another value would comply with what is wrong here."""
        self.extended: dict[str, Entry] = {}
        """What is next to it in a file that its own extends."""

    @property
    def entries(self) -> dict[str, Entry]:
        return dict(self.node.entries) if isinstance(self.node, Mapping) else {}

    def key(self, name: str) -> Span:
        entries = self.entries
        return entries[name].key if name in entries else self.span


def _locate(root: Node, path: Iterable[str | int]) -> _Place:
    node, key, name = root, None, "the file"
    beside: dict[str, Entry] = {}
    for step in path:
        if isinstance(node, Mapping) and str(step) in node.entries:
            entry, beside = node.entries[str(step)], node.entries
            node, key, name = entry.value, entry.key, f"'{step}'"
        elif isinstance(node, Sequence) and isinstance(step, int):
            node, key, name = node.items[step], None, f"item {step + 1} of {name}"
    place = _Place(node, key, name)
    if key is not None:
        place.extended = {other: entry for other, entry in beside.items() if entry.key.file != key.file}
    return place


def _shown(value: object) -> str:
    text = value if isinstance(value, str) else json.dumps(value, default=str)
    return f"'{text if len(text) <= 60 else text[:57] + '...'}'"


_USE = {"uses", "with"}


def _additional(error: Any, place: _Place) -> Iterator[Diagnostic]:
    known = error.schema.get("properties", {})
    beside = unindented(error.instance, known)
    unknown = (name for name in error.instance if name not in known)
    for name in itertools.islice(unknown, MAX_PROBLEMS):
        found = slip_in_key(name, known, is_empty=error.instance[name] is None)
        if found:
            yield Diagnostic(place.key(name), "unknown-key", found.message, found.hint, fix=found.fix)
        elif name not in beside:
            message, fix = f"unknown key {_shown(name)}", only_fix(name, known, error.instance)
            hint = did_you_mean(name, known)
            if set(known) == _USE and not fix:
                hint = f"parameters of a service belong into 'with': {{{name}: ...}}"
            yield Diagnostic(place.key(name), "unknown-key", message, hint, fix=fix)
        elif name == next(key for key in beside if beside[key] == beside[name]):
            message = f"{_shown(name)} is next to '{beside[name]}', which is empty"
            hint = f"indent what belongs to '{beside[name]}'"
            yield Diagnostic(place.key(name), "unknown-key", message, hint)


def _required(error: Any, place: _Place) -> Iterator[Diagnostic]:
    missing = error.validator_value
    known = error.schema.get("properties") or place.about
    almost = next((key for key in error.instance if key not in known and only_fix(key, [missing])), None)
    if almost is not None:
        hint, fix = did_you_mean(almost, [missing]), only_fix(almost, [missing])
        yield Diagnostic(place.key(almost), "unknown-key", f"unknown key {_shown(almost)}", hint, fix=fix)
        return
    schema = known.get(missing, {})
    schema = schema if isinstance(schema, dict) else {}
    hint = f"write '{missing}: {schema['const']}'" if "const" in schema else schema.get("description", "")
    if near := closest(place.name.strip("'"), place.extended):
        hint = f"did you mean '{near[0]}' of {shown_path(place.extended[near[0]].key.file)}?"
    about = () if error.absolute_path else (missing,)
    yield Diagnostic(place.span, "missing-key", f"{place.name} has no key '{missing}'", hint, about=about)


def _companion(error: Any, place: _Place) -> Iterator[Diagnostic]:
    name, missing = error.validator_value
    yield Diagnostic(place.span, "missing-key", f"{place.name} has '{name}' without '{missing}'")


def _type(error: Any, place: _Place) -> Iterator[Diagnostic]:
    if UNIT in error.schema:
        yield from _quantity(error, place)
        return
    wanted = error.validator_value
    names = [_TYPE_NAMES[w] for w in ([wanted] if isinstance(wanted, str) else wanted)]
    found = "is empty" if error.instance is None else f"is {_TYPE_NAMES[_kind(error.instance)]}"
    written = place.node.text if isinstance(place.node, Scalar) else ""
    if error.instance == math.inf and written.isdigit():
        found = f"has {len(written)} digits"
    names = names if error.schema.get("x-expect") != _TYPE_NAMES["boolean"] else [_TYPE_NAMES["boolean"]]
    message = f"{place.name} {found}, expected {' or '.join(names)}"
    hint, fix = error.schema.get(_HINT) or _of_file(place) or _in_quotes(error, place), None
    if not hint and wanted == "array" and "examples" in error.schema:
        hint = f"write for example {place.name[1:-1]}: {_in_line(error.schema['examples'][0])}"
    if wanted == "string" and place.name.endswith(_PAIRS) and isinstance(error.instance, dict) and error.instance:
        name, value = next((key, entry.value) for key, entry in place.entries.items())
        text = value.text if isinstance(value, Scalar) else "value"
        hint = f'write {name}: "{text}" without the dash, or - {name}={text}'
    if not hint:
        hint, fix = _meant(error.instance, wanted, place)
    span = place.span
    if isinstance(place.node, Sequence) and wanted == "object":
        span, hint = place.node.span, hint or "write 'key: value' in place of list items"
    yield Diagnostic(span, "wrong-type", message, hint, fix=fix)


def _of_file(place: _Place) -> str:
    """A hint for the name of a test, which is that of its file; empty elsewhere."""
    file = PurePath(place.span.file).name
    is_name = place.is_of_file and place.name == "'name'" and file.endswith(SUFFIX)
    return as_file(file.removesuffix(SUFFIX), SUFFIX) if is_name else ""


def _in_quotes(error: Any, place: _Place) -> str:
    """A hint for a number or a word that YAML takes for something else than the text that it is."""
    is_text = error.validator == "enum" or error.validator_value == "string"
    if not is_text or not isinstance(place.node, Scalar) or error.instance is None:
        return ""
    text = place.node.text
    expected = error.schema.get("x-expect", "")
    return f'write it in quotes: "{text}"' if place.fits(text) else f"write {expected}" if expected else ""


def _meant(value: object, wanted: object, place: _Place) -> tuple[str, Fix | None]:
    """A hint how to write a value of another type, and the only fix; empty and None for most values."""
    if wanted == "boolean" and isinstance(value, str):
        return boolean_meant(value)
    if isinstance(wanted, list) and "boolean" in wanted and value in (0, 1):
        meant = "true" if value else "false"
        return f"write {meant}; compose takes no number here", Fix(str(value), meant)
    if wanted in ("integer", "number") and isinstance(value, str) and re.fullmatch(r"-?\d{1,20}", value):
        return (f"write {value}, without quotation marks" if place.fits(int(value)) else ""), None
    names = [value] if isinstance(value, str) else list(value) if isinstance(value, dict) else []
    if wanted == "array" and names and place.name.startswith("'") and place.fits(names):
        return f"write {place.name[1:-1]}: {_in_line(names)}", None
    return "", None


def _in_line(value: object) -> str:
    """YAML in one line."""
    return str(yaml.safe_dump(value, default_flow_style=True, allow_unicode=True, width=math.inf)).strip()


def _kind(value: object) -> str:
    kinds: list[tuple[type, str]] = [(bool, "boolean"), (int, "integer"), (float, "number"), (str, "string")]
    kinds += [(dict, "object"), (list, "array")]
    return next((name for kind, name in kinds if isinstance(value, kind)), "null")


def _quantity(error: Any, place: _Place) -> Iterator[Diagnostic]:
    words = error.schema.get(WORDS, ())
    if words and isinstance(error.instance, str) and error.instance[:1].isalpha():
        message = f"{_shown(error.instance)} is not a value of {place.name}, expected {', '.join(words)}"
        hint = did_you_mean(error.instance, words)
        yield Diagnostic(place.span, "wrong-value", message, hint if hint.startswith("did") else "")
        return
    try:
        quantity.convert(place.node.text if isinstance(place.node, Scalar) else None, error.schema[UNIT])
    except quantity.QuantityError as problem:
        yield Diagnostic(place.span, "wrong-unit", f"{place.name}: {problem}", problem.hint, fix=problem.fix)


def _choices(error: Any, place: _Place) -> Iterator[Diagnostic]:
    choices = [str(v) for v in error.validator_value]
    message = f"{_shown(error.instance)} is not a value of {place.name}, expected {', '.join(choices)}"
    plain_ones = [choice for choice in choices if resolve(choice) == choice]
    hint = did_you_mean(str(error.instance), plain_ones)
    hint = hint if hint.startswith("did") else ""
    fix = only_fix(str(error.instance), plain_ones)
    if isinstance(place.node, Scalar) and place.node.text in choices:
        hint, fix = _in_quotes(error, place), None
    if "#" in str(error.instance):
        hint, fix = "a comment begins with ' #', after a space", None
    yield Diagnostic(place.span, "wrong-value", message, hint, fix=fix)


def _const(error: Any, place: _Place) -> Iterator[Diagnostic]:
    message = f"{place.name} is {_shown(error.instance)}, expected {error.validator_value}"
    hint = f"write '{place.name[1:-1]}: {error.validator_value}'"
    if place.name == "'dodo'" and type(error.instance) is int and error.instance > error.validator_value:
        message = f"the file is of language version {error.instance}, the installed DoDo {__version__} reads "
        message += f"{error.validator_value}"
        hint = f"install a DoDo that reads version {error.instance}, or, if the number is a mistake, {hint}"
    yield Diagnostic(place.span, "wrong-value", message, hint)


_MOST_READ = 200


def _pattern(error: Any, place: _Place) -> Iterator[Diagnostic]:
    expected = error.schema.get("x-expect", f"a string that matches {error.schema.get('pattern')}")
    span = place.span
    if "propertyNames" in error.absolute_schema_path:
        span = place.key(str(error.instance))
    hint = _of_file(place)
    if not hint and isinstance(error.instance, str):
        name = re.sub(r"[^a-z0-9]+", "-", error.instance[:_MOST_READ].lower()).strip("-")[:40]
        is_text = name != error.instance and resolve(name) == name != ""
        hint = f"for example '{name}'" if is_text and place.fits(name) else ""
    yield Diagnostic(span, "wrong-value", f"{_shown(error.instance)} is not allowed here, expected {expected}", hint)


def _bounds(error: Any, place: _Place) -> Iterator[Diagnostic]:
    low, high = error.schema.get("minimum"), error.schema.get("maximum")
    message = f"{place.name} is {_shown(error.instance)[1:-1]}, expected {low} to {high}"
    yield Diagnostic(place.span, "out-of-range", message)


def _too_long(error: Any, place: _Place) -> Iterator[Diagnostic]:
    if "x-expect" in error.schema:
        yield from _pattern(error, place)
        return
    message = f"{place.name} has {len(error.instance)} characters, expected at most {error.validator_value}"
    yield Diagnostic(place.span, "too-large", message)


def _too_few(error: Any, place: _Place) -> Iterator[Diagnostic]:
    expected = "a string" if isinstance(error.instance, str) else "at least one entry"
    yield Diagnostic(place.span, "missing-key", f"{place.name} is empty, expected {expected}")


def _too_many(error: Any, place: _Place) -> Iterator[Diagnostic]:
    message = f"{place.name} has {len(error.instance)} entries, expected at most {error.validator_value}"
    yield Diagnostic(place.span, "too-large", message)


def _fallback(error: Any, place: _Place) -> Iterator[Diagnostic]:
    yield Diagnostic(place.span, "wrong-value", f"{place.name}: {error.message[:200]}")


_TRANSLATORS: dict[str, Callable[[Any, _Place], Iterator[Diagnostic]]] = {
    "additionalProperties": _additional,
    "required": _required,
    "dependentRequired": _companion,
    "type": _type,
    UNIT: _quantity,
    "enum": _choices,
    "const": _const,
    "pattern": _pattern,
    "maxLength": _too_long,
    "minimum": _bounds,
    "maximum": _bounds,
    "maxProperties": _too_many,
    "maxItems": _too_many,
    "minProperties": _too_few,
    "minItems": _too_few,
    "minLength": _too_few,
}
