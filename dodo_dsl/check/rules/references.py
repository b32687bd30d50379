"""``unknown-name``: a value that means an entry of a file (an obstacle of the map) is there.

``wrong-file``: that file is JSON of the shape that the manifest names. ``short-timeout``: the test's timeout leaves
room for the longest time that an evaluator waits.
"""

import functools
import json
from collections.abc import Iterator
from pathlib import Path

from dodo_dsl.check.context import Context
from dodo_dsl.diagnostics import Diagnostic, did_you_mean
from dodo_dsl.source import MAX_PROBLEMS, Entry, Scalar, Sequence
from dodo_dsl.spec import arguments
from dodo_dsl.spec.manifest import Manifest, Parameter
from dodo_dsl.spec.model import Use
from dodo_dsl.spec.values import ValueProblem, convert

_MAP = "map.json"
_MAX_BYTES = 20 << 20


def check(context: Context) -> Iterator[Diagnostic]:
    for use, manifest in context.known_uses():
        for name, entry in use.parameters.items():
            parameter = manifest.parameters.get(name)
            if parameter and parameter.among:
                yield from _among(context, use, manifest, parameter, entry)
            if parameter and parameter.within_timeout:
                yield from _within(context, use, parameter, entry)


def _among(context: Context, use: Use, manifest: Manifest, parameter: Parameter, entry: Entry) -> Iterator[Diagnostic]:
    try:
        convert(parameter, entry.value, context.spec.location.root)
    except ValueProblem:
        return
    source, _, key = parameter.among.partition(".")
    file = _file(context, use, manifest.parameters[source])
    if file is None:
        return
    names = _names(file, key)
    if isinstance(names, str):
        yield Diagnostic(entry.value.span, "wrong-file", f"{file.parent.name}/{file.name}: {names}", "see docs/maps.md")
        return
    items = entry.value.items if isinstance(entry.value, Sequence) else (entry.value,)
    for item in items[:MAX_PROBLEMS]:
        if isinstance(item, Scalar) and item.text not in names and "${matrix" not in item.text:
            message = f"there is no '{item.text}' among the {key} of {file.parent.name}/{file.name}"
            yield Diagnostic(item.span, "unknown-name", message, did_you_mean(item.text, names))


def _file(context: Context, use: Use, parameter: Parameter) -> Path | None:
    try:
        given = arguments.value(context.spec, use, parameter, context.rig)
    except ValueProblem:
        return None
    if given is None or given.path is None:
        return None
    return given.path / _MAP if given.path.is_dir() else given.path


@functools.lru_cache(maxsize=256)
def _names(file: Path, key: str) -> tuple[str, ...] | str:
    """The names of the entries of a list in a JSON file, or what is wrong with the file."""
    try:
        if file.exists() and not file.is_file():
            return "this is no plain file"
        if file.stat().st_size > _MAX_BYTES:
            return f"larger than {_MAX_BYTES >> 20} MiB"
        document = json.loads(file.read_text(encoding="utf-8"))
        entries = document.get(key, []) if isinstance(document, dict) else None
        if not isinstance(entries, list):
            return f"expected an object with a list '{key}'"
        return tuple(str(e["name"]) for e in entries if isinstance(e, dict) and "name" in e)
    except OSError as error:
        return f"cannot be read: {error.strerror}"
    except (ValueError, RecursionError) as error:
        return f"not JSON: {str(error)[:120]}"


def _within(context: Context, use: Use, parameter: Parameter, entry: Entry) -> Iterator[Diagnostic]:
    timeout = context.spec.timeout_s
    try:
        given = arguments.value(context.spec, use, parameter, context.rig)
    except ValueProblem:
        return
    if timeout is not None and given is not None and float(given.text) >= timeout:
        written = entry.value.text if isinstance(entry.value, Scalar) else given.text
        message = f"'{use.name}' waits up to {written}, but the test's timeout of {timeout:g} s ends it first"
        hint = "make the timeout longer, so that the evaluator can judge"
        yield Diagnostic(entry.value.span, "short-timeout", message, hint, "warning")
