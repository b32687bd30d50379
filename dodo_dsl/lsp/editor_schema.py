"""What editors complete and explain: the schema of specs with services and parameters.

Only `$defs.use.allOf` and the `$defs` named `with-...` are generated. DoDo validates without the former, because its
rules give better messages. ``scripts/make-schema`` writes the file. What schemas say of keys is that of tests and of
``dodo.yml``.
"""

import json
import re
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from dodo_dsl import atomic, package_data
from dodo_dsl.spec import quantity
from dodo_dsl.spec.manifest import Manifest, Parameter, in_words, load_manifests

Schema = dict[str, Any]

PREFIX = "with-"
_NUMBER = r"[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][-+]?[0-9]{1,3})?"
_REFERENCE = r"\$\{(matrix|vary)\."
_PLACEHOLDER: Schema = {"type": "string", "pattern": _REFERENCE}
_TEXT: Schema = {"type": "string"}


def schema_path() -> Path:
    """The schema's file."""
    return package_data.schemas() / "dodo.schema.json"


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
    schema: Schema = {"description": description(parameter), **_value(parameter)}
    if parameter.default not in (None, []):
        schema["default"] = written(parameter, parameter.default)
    elif parameter.example is not None:
        schema["examples"] = [written(parameter, parameter.example)]
    elif parameter.unit:
        schema["examples"] = [written(parameter, 1)]
    return schema


def description(parameter: Parameter) -> str:
    """What a parameter is for, its range, and who else may give it."""
    facts = [parameter.help]
    if bounds := parameter.bounds:
        facts.append(f"A{bounds[1:]}." if bounds.startswith("at") else f"From {bounds}.")
    if parameter.required and not parameter.rig and not parameter.shared:
        facts.append("Required.")
    if parameter.when:
        facts.append(f"Only {in_words(parameter.when)}.")
    if parameter.rig:
        facts.append(f"Defaults to the rig's {parameter.rig}.")
    return " ".join(facts)


def written(parameter: Parameter, value: Any) -> Any:
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
    if parameter.type == "boolean":
        return {"anyOf": [{"type": "boolean"}, _PLACEHOLDER]}
    if parameter.type == "list":
        if not parameter.of:
            return {"type": ["array", "string"], "items": _TEXT}
        item = _number(replace(parameter, type=parameter.of))
        return {"anyOf": [{"type": "array", "items": item}, item]}
    if parameter.type == "amount":
        return {
            "anyOf": [
                {"type": "number"},
                {"type": "string", "pattern": rf"^\s*{_NUMBER}\s*[A-Za-z0-9%/]+\s*$"},
                _PLACEHOLDER,
            ]
        }
    if parameter.type == "string":
        return {"type": ["string", "number", "boolean"]}
    return dict(_TEXT)


def _number(parameter: Parameter) -> Schema:
    if parameter.unit not in ("", quantity.SHARE):
        units = "|".join(re.escape(u) for u in quantity.UNITS if _converts(u, parameter.unit))
        pattern = rf"^\s*{_NUMBER}\s*({units})\s*$|{_REFERENCE}"
        return {"type": "string", "pattern": pattern, "patternErrorMessage": f"expected a quantity in {parameter.unit}"}
    bounds = {"minimum": parameter.minimum, "maximum": parameter.maximum}
    number: Schema = {"type": parameter.type, **{k: v for k, v in bounds.items() if v is not None}}
    percent = [{"type": "string", "pattern": rf"^\s*{_NUMBER}\s*%\s*$"}] if parameter.unit else []
    return {"anyOf": [number, *percent, _PLACEHOLDER]}


def _converts(written: str, unit: str) -> bool:
    try:
        quantity.convert(f"1 {written}", unit)
    except quantity.QuantityError:
        return False
    return True


def write(file: Path | None = None) -> None:
    """Generates the schema's file from the shipped services."""
    target = file or schema_path()
    atomic.write_text(target, generate(target.read_text(encoding="utf-8"), load_manifests()[0]))


if __name__ == "__main__":
    write()
