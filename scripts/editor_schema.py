"""What editors complete and explain: services and their parameters in the schema of specs, for ``scripts/make-schema``.

Only `$defs.use.allOf` and the `$defs` named `with-...` are generated. DoDo validates without them, because its rules
give better messages.
"""

import json
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any

from dodo_dsl import atomic, package_data
from dodo_dsl.spec import quantity
from dodo_dsl.spec.manifest import Manifest, Parameter, in_words, load_manifests

Schema = dict[str, Any]

FILE = package_data.schemas() / "dodo.schema.json"
PREFIX = "with-"
_NUMBER = r"^\s*[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][-+]?[0-9]{1,3})?"
_REFERENCE = r"\$\{(matrix|vary)\."
_PLACEHOLDER: Schema = {"type": "string", "pattern": _REFERENCE}
_QUANTITY: Schema = {"type": "string", "pattern": rf"{_NUMBER}\s*[A-Za-z%°µ][A-Za-z0-9%/]*\s*$|{_REFERENCE}"}
_SIMPLE: dict[str, Schema] = {
    "boolean": {"anyOf": [{"type": "boolean"}, _PLACEHOLDER]},
    "amount": {"anyOf": [{"type": "number"}, _QUANTITY]},
    "string": {"type": ["string", "number", "boolean"]},
}


def generate(text: str, manifests: Mapping[str, Manifest]) -> str:
    """The text of the schema with these services and their parameters."""
    schema = json.loads(text)
    offered = [m for _, m in sorted(manifests.items()) if not m.automatic]
    definitions = {k: v for k, v in schema["$defs"].items() if not k.startswith(PREFIX)}
    definitions["use"]["allOf"] = [_uses(offered), *map(_when, offered)]
    schema["$defs"] = {**definitions, **{PREFIX + m.name: _with(m) for m in offered}}
    return json.dumps(schema, indent=2, ensure_ascii=False) + "\n"


def _uses(manifests: Iterable[Manifest]) -> Schema:
    """The shipped services by name, and any other name for a deployment's own."""
    known = [{"const": m.name, "description": f"{m.description} Layer: {' or '.join(m.layers)}."} for m in manifests]
    own = {"type": "string", "description": "One of your own services, from 'services' in dodo.yml."}
    return {"properties": {"uses": {"anyOf": [*known, own]}}}


def _when(manifest: Manifest) -> Schema:
    condition = {"required": ["uses"], "properties": {"uses": {"const": manifest.name}}}
    return {"if": condition, "then": {"properties": {"with": {"$ref": f"#/$defs/{PREFIX}{manifest.name}"}}}}


def _with(manifest: Manifest) -> Schema:
    parameters = manifest.parameters.values()
    needed = [p.name for p in parameters if p.required and not p.shared and not p.rig]
    return {
        "type": "object",
        "title": f"{manifest.name}: parameters",
        "description": manifest.description,
        "additionalProperties": False,
        **({"required": needed} if needed else {}),
        "properties": {p.name: _parameter(p) for p in parameters},
    }


def _parameter(parameter: Parameter) -> Schema:
    schema: Schema = {"description": _description(parameter), **_value(parameter)}
    if parameter.default not in (None, []):
        schema["default"] = _written(parameter, parameter.default)
    elif parameter.example is not None:
        schema["examples"] = [_written(parameter, parameter.example)]
    elif parameter.unit:
        schema["examples"] = [_written(parameter, 1)]
    return schema


def _description(parameter: Parameter) -> str:
    """What a parameter is for, its range, and who else may give it."""
    facts = [parameter.help]
    if bounds := parameter.bounds:
        facts.append(f"A{bounds[1:]}." if bounds.startswith("at") else f"From {bounds}.")
    if parameter.required and not parameter.rig and not parameter.shared:
        facts.append("Required.")
    facts += [f"Only {in_words(parameter.when)}."] if parameter.when else []
    facts += [f"Defaults to the rig's {parameter.rig}."] if parameter.rig else []
    return " ".join(facts)


def _written(parameter: Parameter, value: Any) -> Any:
    """A value as an author writes it."""
    bare = parameter.unit in ("", quantity.SHARE)
    if parameter.of and isinstance(value, list):
        return [item if bare else f"{item} {parameter.unit}" for item in value]
    return value if bare or isinstance(value, str | list) else f"{value} {parameter.unit}"


def _value(parameter: Parameter) -> Schema:
    """The allowed values: the value itself, or a placeholder."""
    if parameter.choices:
        return {"anyOf": [{"enum": list(parameter.choices)}, _PLACEHOLDER]}
    if parameter.type in ("number", "integer"):
        return _number(parameter)
    if parameter.type == "list":
        if not parameter.of:
            return {"type": ["array", "string"], "items": {"type": "string"}}
        item = _number(replace(parameter, type=parameter.of))
        return {"anyOf": [{"type": "array", "items": item}, item]}
    return _SIMPLE.get(parameter.type, {"type": "string"})


def _number(parameter: Parameter) -> Schema:
    if parameter.unit not in ("", quantity.SHARE):
        return {**_QUANTITY, "patternErrorMessage": f"expected a quantity in {parameter.unit}"}
    bounds = {"minimum": parameter.minimum, "maximum": parameter.maximum}
    number: Schema = {"type": parameter.type, **{k: v for k, v in bounds.items() if v is not None}}
    percent = [{"type": "string", "pattern": rf"{_NUMBER}\s*%\s*$"}] if parameter.unit else []
    return {"anyOf": [number, *percent, _PLACEHOLDER]}


def write() -> None:
    """Generates the schema's file from the shipped services."""
    atomic.write_text(FILE, generate(FILE.read_text(encoding="utf-8"), load_manifests()[0]))
