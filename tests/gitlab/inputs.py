"""Templates as GitLab includes them: inputs are checked and put into the parsed YAML, then jobs extend others."""

import functools
import json
import re
from pathlib import Path
from typing import Any

import yaml

from dodo_dsl import package_data
from dodo_dsl.package_data import PIPELINES

TEMPLATES = [package_data.templates() / name / "template.yml" for name in PIPELINES]
TYPES = {"string": str, "array": list, "boolean": bool, "number": (int, float)}
KEYWORDS = ("default", "variables", "workflow", "include", "spec")
BLOCK = re.compile(r"\$\[\[\s*inputs\.([\w-]+)\s*\]\]")
Config = dict[str, Any]


class Refused(Exception):
    """GitLab makes no pipeline with such an input."""


def specified(template: Path) -> Config:
    """The inputs that a template takes, by name."""
    return dict(_parsed(template)[0]["spec"]["inputs"])


@functools.cache
def _parsed(template: Path) -> tuple[Config, Config]:
    header, body = yaml.load_all(template.read_text(), Loader=yaml.CSafeLoader)
    return header, body


def included(template: Path, **inputs: Any) -> Config:
    """A template with its inputs, an underscore for each hyphen of their names."""
    config = _parsed(template)[1]
    specs = specified(template)
    given = {name.replace("_", "-"): value for name, value in inputs.items()}
    if unknown := given.keys() - specs.keys():
        raise Refused(f"unknown inputs {unknown}")
    values = {name: given.get(name, spec["default"]) for name, spec in specs.items()}
    for name, value in values.items():
        _check(name, specs[name], value)
    made = dict(_interpolated(config, values))
    for job in made.values():
        if "needs" in job:  # the one list in which GitLab takes lists
            job["needs"] = [need for entry in job["needs"] for need in (entry if isinstance(entry, list) else [entry])]
    return made


def _check(name: str, spec: Config, value: Any) -> None:
    if not isinstance(value, TYPES[spec.get("type", "string")]):  # type: ignore[arg-type]
        raise Refused(f"{name} is no {spec.get('type', 'string')}")
    if "regex" in spec and not re.search(spec["regex"], value):
        raise Refused(f"{name} does not match")
    if value not in spec.get("options", [value]):
        raise Refused(f"{name} is none of {spec['options']}")


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
    """As Ruby writes it within a text; lists are of texts alone."""
    return value if isinstance(value, str) else json.dumps(value)


def merged(*configs: Config) -> Config:
    """Files that are included one after the other, as one."""
    made: Config = {}
    for config in configs:
        made = _merged(made, config)
    return made


def jobs(*configs: Config) -> Config:
    """The jobs of files that are included one after the other, each with what it extends."""
    config = merged(*configs)
    found = {
        name: _extended(name, config)
        for name, value in config.items()
        if isinstance(value, dict) and name not in KEYWORDS and not name.startswith(".")
    }
    return {name: job for name, job in found.items() if {"script", "trigger"} & job.keys()}


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
