"""``unknown-name``: a value names an entry of a file, such as an obstacle of the map.

``wrong-file``: that file, if its parameter has no format (see files.py), is JSON of the shape that the manifest names.
``short-timeout``: the test's timeout leaves room for the longest time that an evaluator waits.
"""

import functools
import json
import re
from collections.abc import Iterator
from pathlib import Path

from dodo_dsl.check.context import RuleContext
from dodo_dsl.check.rules.inputs.files import file_problems
from dodo_dsl.diagnostics import Diagnostic, did_you_mean, has_errors, only_fix
from dodo_dsl.source import MAX_PROBLEMS, Entry, Scalar, Sequence
from dodo_dsl.spec.arguments import Argument, ResolvedService

MAP = "map.json"
"""The map in its folder."""
_MAX_BYTES = 20 << 20
_ATTEMPT = re.compile(r"\$\{(matrix|vary)")
"""A placeholder that nothing has replaced, which another rule reports."""
_CLASSES = "categories"
_HELP = {"obstacles": "see docs/reference/maps.md"}


def check(context: RuleContext) -> Iterator[Diagnostic]:
    for service in context.services:
        for name, entry in service.use.parameters.items():
            argument = service.arguments.get(name)
            if argument and argument.value and argument.parameter.among:
                yield from _among(context, service, argument, entry)
            if argument and argument.value and argument.parameter.within_timeout:
                yield from _within(context, service, argument.value.text, entry)


def _among(context: RuleContext, service: ResolvedService, argument: Argument, entry: Entry) -> Iterator[Diagnostic]:
    source, _, key = argument.parameter.among.partition(".")
    file = _file(service.arguments[source])
    if file is None:
        return
    names = _names(file, key)
    if has_errors(file_problems(context, service, service.arguments[source])):
        return  # told with the file
    if isinstance(names, str):
        yield Diagnostic(entry.value.span, "wrong-file", f"{file.parent.name}/{file.name}: {names}", _HELP.get(key, ""))
        return
    items = entry.value.items if isinstance(entry.value, Sequence) else (entry.value,)
    for item in items[:MAX_PROBLEMS]:
        if isinstance(item, Scalar) and item.text not in names and not _ATTEMPT.search(item.text):
            message = f"'{item.text}' is not among the {key} of {file.parent.name}/{file.name}"
            hint, fix = did_you_mean(item.text, names), only_fix(item.text, names)
            yield Diagnostic(item.span, "unknown-name", message, hint, fix=fix)


def _file(argument: Argument) -> Path | None:
    path = argument.value.path if argument.value else None
    if path is None:
        return None
    return path / MAP if path.is_dir() else path


def _names(file: Path, key: str) -> tuple[str, ...] | str:
    """The names of the entries of a list in a JSON file, or the problem of the file."""
    found = entries(file, key)
    return found if isinstance(found, str) else tuple(dict.fromkeys(name for name in found if name))


@functools.lru_cache(maxsize=256)
def entries(file: Path, key: str) -> tuple[str, ...] | str:
    """The entries of a list in a JSON file by name, empty for those without one, or the problem of the file.

    A class may be written with ``color:`` before its name, as in messages.
    """
    try:
        if file.exists() and not file.is_file():
            return "not a regular file"
        if file.stat().st_size > _MAX_BYTES:
            return f"larger than {_MAX_BYTES >> 20} MiB"
        document = json.loads(file.read_text(encoding="utf-8"))
        found = document.get(key, []) if isinstance(document, dict) else None
        if not isinstance(found, list):
            return f"expected an object with a list '{key}'"
        plain = _plain if key == _CLASSES else str
        return tuple(plain(e["name"]) if isinstance(e, dict) and "name" in e else "" for e in found)
    except OSError as error:
        return f"cannot be read: {error.strerror}"
    except (ValueError, RecursionError) as error:
        return f"not JSON: {str(error)[:120]}"


def _plain(name: object) -> str:
    return str(name).strip().removeprefix("color:").strip()


def _within(context: RuleContext, service: ResolvedService, seconds: str, entry: Entry) -> Iterator[Diagnostic]:
    timeout = context.spec.timeout_s
    if timeout is not None and float(seconds) >= timeout:
        written = entry.value.text if isinstance(entry.value, Scalar) else seconds
        message = f"'{service.use.name}' waits up to {written}, but the test's timeout of {timeout:g} s ends it first"
        hint = "use a longer timeout, so that the evaluator can judge"
        yield Diagnostic(entry.value.span, "short-timeout", message, hint, "warning")
