"""``unknown-message`` in manifests of own services: each message that a service reads or sends is known."""

import re
from collections.abc import Collection, Iterator
from pathlib import Path

from dodo_dsl.check.rules.messages import unknown_message
from dodo_dsl.diagnostics import Diagnostic
from dodo_dsl.source import Mapping, Reader, Scalar, walk

_NAME = re.compile(r"[\w.]+")


def problems(folders: tuple[Path, ...], reader: Reader, known: Collection[str]) -> Iterator[Diagnostic]:
    """The messages that are not ``known`` in ``<folder>/<service>/service.yml``; a placeholder is for the test to name.

    Loading these files reports whatever else is wrong with them.
    """
    for folder in folders:
        for path in sorted(folder.glob("*/service.yml")):
            node, _ = reader(path)
            ports = node.get("messages") if isinstance(node, Mapping) else None
            for scalar in walk(ports) if ports is not None else ():
                name = scalar.text.partition("/")[0].removesuffix("?") if isinstance(scalar, Scalar) else ""
                if _NAME.fullmatch(name):
                    yield from unknown_message(name, known, scalar.span)
