"""``schemas/results.schema.json``, made of the classes that ``results.json`` is written from and read into."""

import ast
import inspect
import itertools
import json
from typing import Any

import msgspec

from dodo_dsl import outcome, package_data
from dodo_dsl.report import results
from dodo_dsl.spec import model

FILE = package_data.schemas() / "results.schema.json"
Schema = dict[str, Any]


def texts(kind: type) -> dict[str, str]:
    """What the source says below each field of a class."""
    found: dict[str, str] = {}
    for part in kind.__mro__[-2::-1]:
        tree: Any = ast.parse("" if part is dict else inspect.getsource(part))
        body = tree.body[0].body if tree.body else []
        for field, below in itertools.pairwise(body):
            if isinstance(field, ast.AnnAssign) and isinstance(below, ast.Expr):
                found[ast.unparse(field.target)] = " ".join(ast.literal_eval(below.value).split())
    return found


def simple(node: Any) -> Any:
    """The same without what says nothing, and with a list of types where there are several."""
    if isinstance(node, list):
        return [simple(each) for each in node]
    if not isinstance(node, dict):
        return node
    found = {key: simple(value) for key, value in node.items() if key not in ("default", "title")}
    if "enum" in found:
        return {"enum": found["enum"]}
    options = found.get("anyOf", [])
    if {"type": "number"} in options:
        options = [each for each in options if each != {"type": "integer"}]
    if options and all("type" in each for each in options):
        words = {key: value for each in options for key, value in each.items() if key != "type"}
        types = [each["type"] for each in options]
        rest = {key: value for key, value in found.items() if key != "anyOf"}
        return {"type": types if types[1:] else types[0], **words, **rest}
    return found


def described(name: str, node: Schema) -> Schema:
    """An object's schema with what its class says of each field; what is written has all fields but a few."""
    kind: Any = next(vars(module)[name] for module in (outcome, results, model) if name in vars(module))
    properties = {key: {**simple(node["properties"][key]), "description": said} for key, said in texts(kind).items()}
    is_partly = kind is results.Results or issubclass(kind, dict)
    required = [key for key in properties if not is_partly or key in node["required"]]
    return {
        "type": "object",
        "description": inspect.getdoc(kind),
        "additionalProperties": False,
        "required": required,
        "properties": properties,
    }


def text() -> str:
    """The file's text: a line for each class."""
    schema = msgspec.json.schema(results.Results)
    classes = {name: described(name, node) for name, node in schema["$defs"].items()}
    head = {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": "DoDo results"} | classes.pop("Results")
    lines = ",\n".join(f"{json.dumps(name)}: {json.dumps(node, ensure_ascii=False)}" for name, node in classes.items())
    return f'{json.dumps(head, ensure_ascii=False)[:-1]}, "$defs": {{\n{lines}\n}}}}\n'
