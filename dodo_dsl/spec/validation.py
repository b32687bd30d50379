"""A document against its JSON Schema: what is wrong, at its line and column, and the part of it that is valid."""

import contextlib
import functools
import itertools
import json
import math
import operator
import sys
from collections.abc import Callable, Collection, Iterator
from typing import Any

from dodo_dsl import __version__, package_data
from dodo_dsl.diagnostics import Diagnostic, closest, did_you_mean, shown_path
from dodo_dsl.source import MAX_PROBLEMS, Entry, Mapping, Node, Scalar, Sequence, plain, resolve
from dodo_dsl.spec import quantity
from dodo_dsl.spec.matrix import REPORTED
from dodo_dsl.spec.slips import boolean_meant, home, in_line, meant, schema_at, to_write, unknown_key

OF_COMPOSE = "application"
UNIT, RANGE, WORDS, EXPECT = "x-unit", "x-range", "x-words", "x-expect"
"""The unit of a quantity, its bounds, words that may stand in place of it, and in words what a pattern asks for."""
_WHOLE = "x-whole"
"""Beside ``type: integer``, for JSON Schema takes 1.0 for a whole number."""
_TYPE_NAMES = {
    "object": "a mapping (key: value)",
    "array": "a list",
    "string": "a string",
    "integer": "a whole number",
    "number": "a number",
    "boolean": "true or false",
    "null": "no value",
}

Path = tuple[str | int, ...]


@functools.cache
def schema_of_keys(name: str) -> dict[str, Any]:
    """``schemas/<name>.schema.json`` without references, and without what is for editors alone."""
    file = _file(name, None if name == OF_COMPOSE else _exact)
    if (use := file.get("$defs", {}).get("use")) is not None:
        use.pop("allOf")  # parameters are read by their manifests
        use["properties"]["with"].pop("additionalProperties")
        use["required"] = ["uses"]  # what a test extends is merged here, of which editors know nothing
        file["else"].pop("properties")
    found: dict[str, Any] = _inlined(file, file)
    del found["$defs"]
    return found


def _file(name: str, hook: Callable[[dict[str, Any]], dict[str, Any]] | None) -> dict[str, Any]:
    text = (package_data.schemas() / f"{name}.schema.json").read_text(encoding="utf-8")
    return json.loads(text, object_hook=hook)  # type: ignore[no-any-return]


def _inlined(part: Any, root: dict[str, Any]) -> Any:
    if isinstance(part, list):
        return [_inlined(each, root) for each in part]
    if not isinstance(part, dict):
        return part
    base = {}
    if isinstance(part.get("$ref"), str):
        file, _, pointer = part["$ref"].partition("#/")
        there = _file(file.removesuffix(".schema.json"), _exact) if file else root
        base = _inlined(functools.reduce(operator.getitem, pointer.split("/"), there), there)
    return {**base, **{key: _inlined(value, root) for key, value in part.items() if key != "$ref"}}


def values(node: Node, schema: dict[str, Any]) -> Any:
    """A valid node as ``plain`` has it, with quantities as numbers in their units; the schema has no references."""
    if isinstance(node, Mapping):
        return {key: values(entry.value, schema_at(schema, key)) for key, entry in node.entries.items()}
    if isinstance(node, Scalar) and UNIT in schema and node.text not in schema.get(WORDS, ()):
        return float(quantity.convert(node.text, schema[UNIT]))
    if isinstance(node, Scalar) and isinstance(node.value, float) and not math.isfinite(node.value):
        return node.text  # as which it is validated
    return plain(node)


def _exact(part: dict[str, Any]) -> dict[str, Any]:
    return part | {_WHOLE: True} if part.get("type") == "integer" else part


class _Quantity:
    def __init__(self, schema: dict[str, Any], unit: str, _: object) -> None:
        self._words, self._unit = schema.get(WORDS, ()), unit

    def validate(self, instance: object) -> None:
        if isinstance(instance, str | int | float) and instance not in self._words:
            quantity.convert(instance, self._unit)


class _Range:
    def __init__(self, schema: dict[str, Any], bounds: list[str], _: object) -> None:
        self._unit = schema[UNIT]
        self._low, self._high = (quantity.convert(bound, self._unit) for bound in bounds)

    def validate(self, instance: object) -> None:
        with contextlib.suppress(quantity.QuantityError):  # of which the unit is wrong
            if not self._low <= quantity.convert(instance, self._unit) <= self._high:
                raise ValueError(instance)


class _Whole:
    def __init__(self, *_: object) -> None: ...

    def validate(self, instance: object) -> None:
        if isinstance(instance, float):
            raise TypeError(instance)


def _validator(schema: dict[str, Any]) -> Any:
    import jsonschema_rs

    return jsonschema_rs.Draft202012Validator(schema, keywords={UNIT: _Quantity, RANGE: _Range, _WHOLE: _Whole})


@functools.cache
def _validator_of(name: str) -> Any:
    return _validator(schema_of_keys(name))


class Violation:
    """A keyword of a schema that a value violates, where that is, and what is there.

    ``wanted`` is the keyword's value. ``of_key`` is a key that is wrong itself, and not its value. ``span`` is that of
    the value, or of its key where it is a collection. ``known`` are the keys that may stand there, ``is_closed`` if no
    others may. ``inherited`` is what is next to it in a file that its own extends.
    """

    def __init__(self, error: Any, root: Node, name: str) -> None:
        *steps, self.keyword = error.evaluation_path
        self.path: Path = tuple(error.instance_path)
        self.schema: Any = functools.reduce(operator.getitem, steps, schema_of_keys(name))
        self.wanted = error.kind.property if self.keyword == "required" else self.schema[self.keyword]
        is_of_key = error.kind.name == "propertyNames"
        self.instance: Any = error.kind.error.instance if is_of_key else error.instance
        self.of_key: str | None = self.instance if is_of_key else None
        self.top = schema_of_keys(name)
        around = self.schema if self.path else self.top
        self.known, self.is_closed = around.get("properties", {}), around.get("additionalProperties") is False
        self._find(root)

    def _find(self, root: Node) -> None:
        node, key, name = root, None, "the file"
        beside: dict[str, Entry] = {}
        for step in self.path:
            if isinstance(node, Mapping):
                beside, entry = node.entries, node.entries[str(step)]
                node, key, name = entry.value, entry.key, f"'{step}'"
            elif isinstance(node, Sequence):
                node, key, name = node.items[int(step)], None, f"item {int(step) + 1} of {name}"
        self.node, self.name = node, name
        self.span = node.span if isinstance(node, Scalar) and node.text else key or node.span
        self.key = name[1:-1] if name.startswith("'") else ""
        self.text = node.text if isinstance(node, Scalar) else ""
        self.entries: dict[str, Entry] = dict(node.entries) if isinstance(node, Mapping) else {}
        self.inherited = {k: e for k, e in beside.items() if key is not None and e.key.file != key.file}

    @property
    def places(self) -> Iterator[Path]:
        """What is not valid: without it the rest is, as far as this violation goes."""
        if self.keyword == "additionalProperties":
            known = self.schema.get("properties", {})
            yield from ((*self.path, name) for name in self.instance if name not in known)
        elif self.path or self.of_key:
            yield self.path if self.of_key is None else (*self.path, self.of_key)


def _violations(document: object, root: Node, name: str) -> list[Violation]:
    """At most MAX_PROBLEMS; of several about one value the first about its type alone."""
    errors = itertools.islice(_validator_of(name).iter_errors(document), MAX_PROBLEMS)
    found = [Violation(error, root, name) for error in errors]
    typed = {v.path: v for v in reversed(found) if v.keyword in ("type", UNIT, _WHOLE) and v.of_key is None}
    return [v for v in found if v.of_key or typed.get(v.path, v) is v]


def validate(node: Node, schema: str) -> list[Diagnostic]:
    """All violations of ``schemas/<schema>.schema.json``; tags are refused as well."""
    return valid_part(node, schema)[1]


def valid_part(node: Node, schema: str) -> tuple[Node | None, list[Diagnostic], set[Path]]:
    """What of a document its schema allows, what is wrong with the rest, and where that is.

    Values with the tag REPORTED are not judged. A service's parameters stay, as they are read by its manifest.
    """
    found, places, tagged = list[Diagnostic](), set[Path](), list[tuple[Path, Node]]()
    document = _document(node, (), tagged, schema == OF_COMPOSE)
    for path, one in tagged:
        if "with" not in path:
            places.add(path)
        if one.tag != REPORTED:
            tag = one.tag.replace("tag:yaml.org,2002:", "!!")
            hint = "remove the tag, or write a text in quotes"
            found.append(Diagnostic(one.span, "yaml-tag", f"tag '{tag}' is not supported", hint))
    known = set(places)
    for violation in _violations(document, node, schema):
        missing = {(*violation.path, violation.wanted)} if violation.keyword == "required" else set()
        if violation.path in known or missing & known:
            continue
        found += _TRANSLATORS.get(violation.keyword, _other)(violation)
        places |= {*violation.places}
    return _without(node, (), places), found, places


def _document(node: Node, path: Path, tagged: list[tuple[Path, Node]], is_compose: bool) -> Any:
    """As ``plain``, but for numbers that JSON does not have: their texts, or for compose the largest one.

    What is ``tagged`` is added to the list.
    """
    if node.tag:
        tagged.append((path, node))
    if isinstance(node, Mapping):
        return {key: _document(entry.value, (*path, key), tagged, is_compose) for key, entry in node.entries.items()}
    if isinstance(node, Sequence):
        return [_document(item, (*path, number), tagged, is_compose) for number, item in enumerate(node.items)]
    if isinstance(node.value, float) and not math.isfinite(node.value):
        return sys.float_info.max if is_compose else node.text
    return node.value


def without_places(node: Mapping, places: Collection[Path]) -> Mapping:
    rest = _without(node, (), places)
    return rest if isinstance(rest, Mapping) else Mapping(node.span, {})


def _without(node: Node, path: Path, places: Collection[Path]) -> Node | None:
    if not places:
        return node
    if path in places:
        return None
    if isinstance(node, Mapping):
        below = {key: (entry, _without(entry.value, (*path, key), places)) for key, entry in node.entries.items()}
        return Mapping(
            node.span, {key: Entry(entry.key, value) for key, (entry, value) in below.items() if value is not None}
        )
    if isinstance(node, Sequence):
        items = (_without(item, (*path, number), places) for number, item in enumerate(node.items))
        return Sequence(node.span, tuple(item for item in items if item is not None))
    return node


def _shown(value: object) -> str:
    text = value if isinstance(value, str) else json.dumps(value, default=str)
    return f"'{text if len(text) <= 60 else text[:57] + '...'}'"


def _fits(schema: dict[str, Any], value: object) -> bool:
    return bool(_validator(schema).is_valid(value))


def _additional(v: Violation) -> Iterator[Diagnostic]:
    known = v.schema.get("properties", {})
    for *_, name in itertools.islice(v.places, MAX_PROBLEMS):
        slip, hint = unknown_key(str(name), known)
        if not slip and not closest(str(name), known) and set(known) == {"uses", "with"}:
            hint = f"parameters of a service belong into 'with': {{{name}: ...}}"
        elif not slip:
            hint = home(str(name), v.entries, v.schema) or hint
        message = slip or f"unknown key {_shown(name)}"
        yield Diagnostic(v.entries[str(name)].key, "unknown-key", message, hint)


def _required(v: Violation) -> Iterator[Diagnostic]:
    missing, known = v.wanted, v.known
    unknown = [name for name in v.instance if name not in known]
    if v.is_closed and any(meant(name, known) == missing for name in unknown):
        return  # it is reported as an unknown key
    if not v.is_closed and (almost := next((name for name in unknown if closest(name, [missing])), "")):
        hint = did_you_mean(almost, [missing])
        yield Diagnostic(v.entries[almost].key, "unknown-key", f"unknown key {_shown(almost)}", hint)
        return
    hint = to_write(missing, known.get(missing, {}))
    if v.key in known and v.path:
        hint = f"indent '{v.key}' if it belongs to what stands above it"
    elif v.key in v.top["properties"] and len(v.path) > 1:
        hint = f"begin '{v.key}' in the first column if it is the file's"
    if near := closest(v.key, v.inherited):
        hint = f"did you mean '{near[0]}' of {shown_path(v.inherited[near[0]].key.file)}?"
    yield Diagnostic(v.span, "missing-key", f"{v.name} has no key '{missing}'", hint)


def _companion(v: Violation) -> Iterator[Diagnostic]:
    for name, others in v.wanted.items():
        for missing in others if name in v.instance else ():
            if missing not in v.instance:
                yield Diagnostic(v.span, "missing-key", f"{v.name} has '{name}' without '{missing}'")


def _type(v: Violation) -> Iterator[Diagnostic]:
    schema, value = v.schema, v.instance
    if UNIT in schema:
        yield from _quantity(v)
        return
    wanted = schema["type"]
    names = [_TYPE_NAMES[each] for each in ([wanted] if isinstance(wanted, str) else wanted)]
    found = _shown(v.text) if v.text else "empty"
    if isinstance(value, dict | list):
        found = _TYPE_NAMES["object" if isinstance(value, dict) else "array"]
    span, hint = v.span, _in_quotes(v)
    if isinstance(v.node, Sequence) and wanted == "object":
        span, hint = v.node.span, "write 'key: value' in place of list items"
    elif wanted == "array" and isinstance(value, str) and _fits(schema, [value]):
        hint = f"write {v.key}: {in_line([value])}"
    elif wanted == "boolean" and isinstance(value, str):
        hint = boolean_meant(value)
    yield Diagnostic(span, "wrong-type", f"{v.name} is {found}, expected {' or '.join(names)}", hint)


def _in_quotes(v: Violation) -> str:
    """A hint for a number or a word that YAML takes for something else than the text that it is."""
    is_text = v.keyword == "enum" or v.schema.get("type") == "string"
    if not is_text or not v.text or v.instance is None:
        return ""
    expected = v.schema.get(EXPECT, "")
    is_right = _fits(v.schema, v.text)
    return f'write it in quotes: "{v.text}"' if is_right else f"write {expected}" if expected else ""


def _quantity(v: Violation) -> Iterator[Diagnostic]:
    words = v.schema.get(WORDS, ())
    if words and isinstance(v.instance, str) and v.text[:1].isalpha():
        yield from _choices(v)
        return
    try:
        quantity.convert(v.text if isinstance(v.node, Scalar) else None, v.schema[UNIT])
    except quantity.QuantityError as problem:
        yield Diagnostic(v.span, "wrong-unit", f"{v.name}: {problem}", problem.hint)


def _choices(v: Violation) -> Iterator[Diagnostic]:
    choices = [str(v) for v in v.schema.get("enum") or v.schema[WORDS]]
    message = f"{_shown(v.instance)} is not a value of {v.name}, expected {', '.join(choices)}"
    near = [choice for choice in closest(str(v.instance), choices) if resolve(choice) == choice]
    hint = did_you_mean(str(v.instance), near)
    if v.text in choices:
        hint = _in_quotes(v)
    yield Diagnostic(v.span, "wrong-value", message, hint)


def _const(v: Violation) -> Iterator[Diagnostic]:
    message, hint = f"{v.name} is {_shown(v.instance)}, expected {v.wanted}", f"write '{v.key}: {v.wanted}'"
    if v.key == "dodo":
        message += f", which the installed DoDo {__version__} reads"
    yield Diagnostic(v.span, "wrong-value", message, hint)


def _pattern(v: Violation) -> Iterator[Diagnostic]:
    value = str(v.instance)
    expected = v.schema.get(EXPECT, f"a string that matches {v.schema.get('pattern')}")
    span = v.span if v.of_key is None else v.entries[v.of_key].key
    yield Diagnostic(span, "wrong-value", f"{_shown(value)} is not allowed here, expected {expected}")


def _bounds(v: Violation) -> Iterator[Diagnostic]:
    low, high = v.schema.get(RANGE) or (v.schema.get("minimum"), v.schema.get("maximum"))
    yield Diagnostic(v.span, "out-of-range", f"{v.name} is {_shown(v.text)}, expected {low} to {high}")


def _count(v: Violation) -> Iterator[Diagnostic]:
    if v.keyword.startswith("min"):
        expected = "a string" if v.keyword == "minLength" else "at least one entry"
        yield Diagnostic(v.span, "missing-key", f"{v.name} is empty, expected {expected}")
    elif EXPECT in v.schema:
        yield from _pattern(v)
    else:
        what = "characters" if v.keyword == "maxLength" else "entries"
        message = f"{v.name} has {len(v.instance)} {what}, expected at most {v.wanted}"
        yield Diagnostic(v.span, "too-large", message)


def _other(v: Violation) -> Iterator[Diagnostic]:
    message = f"{v.name} does not fit '{v.keyword}' of its schema: {_shown(v.wanted)}"
    yield Diagnostic(v.span, "wrong-value", message)


_TRANSLATORS: dict[str, Callable[[Violation], Iterator[Diagnostic]]] = {
    "additionalProperties": _additional,
    "required": _required,
    "dependentRequired": _companion,
    "type": _type,
    _WHOLE: _type,
    UNIT: _quantity,
    RANGE: _bounds,
    "enum": _choices,
    "const": _const,
    "pattern": _pattern,
    **dict.fromkeys(("minimum", "maximum"), _bounds),
    **dict.fromkeys(("maxLength", "maxProperties", "maxItems", "minProperties", "minItems", "minLength"), _count),
}
