"""Variables of a service: which files set some, and which of them carry the CID."""

import re
from collections.abc import Iterator
from pathlib import Path

from dodo_dsl import source
from dodo_dsl.application.compose_files import variables_of
from dodo_dsl.application.opendlv_flags import CID_VARIABLES
from dodo_dsl.source import Scalar


def image_variable(service: str) -> str:
    """The variable by which a pipeline hands a service's image."""
    return "DODO_IMAGE_" + re.sub(r"[^A-Z0-9_]", "_", service.upper())


def env_files(service: source.Mapping) -> Iterator[tuple[Scalar, bool]]:
    """The paths of ``env_file``, and whether each must be there."""
    node = service.get("env_file")
    for item in node.items if isinstance(node, source.Sequence) else (node,):
        path = item.get("path") if isinstance(item, source.Mapping) else item
        required = item.get("required") if isinstance(item, source.Mapping) else None
        if isinstance(path, Scalar) and isinstance(path.value, str):
            yield path, not (isinstance(required, Scalar) and required.value is False)


def told_in_files(service: source.Mapping, folder: Path) -> tuple[str, ...]:
    """The CID variables that files beside the compose file set."""
    found: set[str] = set()
    for word, _ in env_files(service):
        if not word.text.startswith(("/", "~", "$")):
            found |= set(variables_of(folder / word.text))
    return tuple(v for v in CID_VARIABLES if v in found)
