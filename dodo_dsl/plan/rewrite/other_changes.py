"""Changes of the copy that no step has noted: what a test adds to every service, and paths."""

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from dodo_dsl.application.model import ApplicationSource, plain
from dodo_dsl.plan.rewrite.service_copy import ServiceCopy

Service = Mapping[str, Any]


def note_others(copy: ServiceCopy, written: Service, with_paths: Service) -> None:
    """Notes each key that differs from the file and that no change of the service names.

    ``written`` is the service as in the file, ``with_paths`` the same with paths as seen from the test's folder.
    """
    if moved := [key for key, value in with_paths.items() if written.get(key) != value]:
        copy.note(f"paths start at this folder: {', '.join(sorted(moved))}")
    noted = [line for line in copy.changes if line.startswith(f"{copy.name}: ")]
    for words, keys in (
        ("changed for the test", [key for key, value in copy.service.items() if with_paths.get(key, value) != value]),
        ("added for the test", [key for key in copy.service if key not in with_paths]),
        ("left out", [key for key in with_paths if key not in copy.service]),
    ):
        if unnamed := sorted(key for key in keys if not _is_named(key, noted)):
            copy.note(f"{words}: {', '.join(unnamed)}")


def of_top_level(application: ApplicationSource, rest: Mapping[str, Any]) -> Iterator[str]:
    """Of the file's keys beside ``services``: ``rest`` is what the copy has of them."""
    changed = [key for key, node in application.rest.items() if rest[key] != plain(node)]
    for words, keys in (("changed for the test", changed), ("left out", application.left_out)):
        if keys:
            yield f"{words}: {', '.join(sorted(keys))}"


def of_all(changes: Sequence[str], names: Sequence[str]) -> list[str]:
    """The changes, where those that all of several services have are one each, after the others."""
    texts = {
        name: [line.removeprefix(f"{name}: ") for line in changes if line.startswith(f"{name}: ")] for name in names
    }
    common = (
        [text for text in texts[names[0]] if all(text in other for other in texts.values())] if len(names) > 1 else []
    )
    repeated = {f"{name}: {text}" for name in names for text in common}
    return [*(line for line in changes if line not in repeated), *(f"all services: {text}" for text in common)]


def _is_named(key: str, lines: Sequence[str]) -> bool:
    return any(re.search(rf"(?<![\w-]){re.escape(key)}(?![\w-])", line) for line in lines)
