"""Templates as GitLab includes them: inputs are checked and put into the parsed YAML, then jobs extend others."""

import re
from pathlib import Path
from typing import Any

import yaml

from dodo_dsl import package_data
from dodo_dsl.cli.new.repository_files import PIPELINES

TEMPLATES = [package_data.templates() / name / "template.yml" for name in PIPELINES]
TYPES = {"string": str, "array": list, "boolean": bool, "number": (int, float)}
BLOCK = re.compile(r"\$\[\[\s*inputs\.([\w-]+)\s*\]\]")
Config = dict[str, Any]


class Refused(Exception):
    """GitLab makes no pipeline with such an input."""


def specified(template: Path) -> Config:
    """The inputs that a template takes, by name."""
    header, _ = yaml.safe_load_all(template.read_text())
    return dict(header["spec"]["inputs"])


def included(template: Path, **inputs: Any) -> Config:
    """A template with its inputs, an underscore for each hyphen of their names."""
    _, config = yaml.safe_load_all(template.read_text())
    specs = specified(template)
    given = {name.replace("_", "-"): value for name, value in inputs.items()}
    if unknown := given.keys() - specs.keys():
        raise Refused(f"unknown inputs {unknown}")
    values = {name: given.get(name, spec["default"]) for name, spec in specs.items()}
    for name, value in values.items():
        _check(name, specs[name], value)
    return dict(_interpolated(config, values))


def _check(name: str, spec: Config, value: Any) -> None:
    if not isinstance(value, TYPES[spec.get("type", "string")]):  # type: ignore[arg-type]
        raise Refused(f"{name} is no {spec.get('type', 'string')}")
    if "regex" in spec and not re.search(spec["regex"], value):
        raise Refused(f"{name} does not match")


def _interpolated(node: Any, values: Config) -> Any:
    """A text that is one block becomes the value, of its type; within a longer text it is a text."""
    if isinstance(node, dict):
        return {_interpolated(key, values): _interpolated(value, values) for key, value in node.items()}
    if isinstance(node, list):
        return [_interpolated(value, values) for value in node]
    if not isinstance(node, str):
        return node
    if whole := BLOCK.fullmatch(node):
        return values[whole[1]]
    return BLOCK.sub(lambda found: _text(values[found[1]]), node)


def _text(value: Any) -> str:
    """As Ruby writes it."""
    if isinstance(value, bool):
        return str(value).lower()
    return "[" + ", ".join(f'"{word}"' for word in value) + "]" if isinstance(value, list) else str(value)


def jobs(*configs: Config) -> Config:
    """The jobs of files that are included one after the other, each with what it extends."""
    merged: Config = {}
    for config in configs:
        merged = _merged(merged, config)
    found = {name: _extended(name, merged) for name in merged if not name.startswith(".")}
    return {name: job for name, job in found.items() if "script" in job or "trigger" in job}


def is_run(job: Config, variables: dict[str, str]) -> bool:
    """Whether a job's rules add it to a pipeline with these variables."""
    first = next((rule for rule in job["rules"] if _holds(rule.get("if", '""==""'), variables)), {"when": "never"})
    return bool(first.get("when") != "never")


def _holds(condition: str, variables: dict[str, str]) -> bool:
    """Of what the templates use: ``&&``, ``==``, texts in quotation marks, and variables; one alone is not empty."""
    return all(_agree([_value(side.strip(), variables) for side in part.split("==")]) for part in condition.split("&&"))


def _agree(sides: list[str]) -> bool:
    return len(set(sides)) == 1 and (len(sides) > 1 or bool(sides[0]))


def _value(word: str, variables: dict[str, str]) -> str:
    if word.startswith("$"):
        return variables.get(word[1:], "")
    assert re.fullmatch(r'"[^"]*"', word), word
    return word[1:-1]


def _extended(name: str, config: Config) -> Config:
    job = dict(config[name])
    above = job.pop("extends", [])
    made: Config = {}
    for parent in [above] if isinstance(above, str) else above:
        made = _merged(made, _extended(parent, config))
    return _merged(made, job)


def _merged(below: Config, above: Config) -> Config:
    both = {key: _merged(below[key], above[key]) for key in below.keys() & above.keys() if _are_maps(below, above, key)}
    return {**below, **above, **both}


def _are_maps(below: Config, above: Config, key: str) -> bool:
    return isinstance(below[key], dict) and isinstance(above[key], dict)
