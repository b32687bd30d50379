"""A service's variables: the one for its image, the files that set others, and those that carry the CID."""

import re
from collections.abc import Iterable, Iterator
from pathlib import Path

from dodo_dsl import source
from dodo_dsl.application.compose_files import variables_of
from dodo_dsl.application.host_access import is_true
from dodo_dsl.application.model import EnvFile
from dodo_dsl.application.opendlv_flags import CID_VARIABLES
from dodo_dsl.source import Scalar


def image_variable(service: str) -> str:
    """The variable with which a pipeline sets a service's image."""
    return "DODO_IMAGE_" + re.sub(r"[^A-Z0-9_]", "_", service.upper())


def env_files(service: source.Mapping) -> Iterator[EnvFile]:
    """The files of ``env_file``."""
    node = service.get("env_file")
    for item in node.items if isinstance(node, source.Sequence) else (node,):
        path = item.get("path") if isinstance(item, source.Mapping) else item
        required = item.get("required") if isinstance(item, source.Mapping) else None
        if isinstance(path, Scalar) and isinstance(path.value, str):
            optional = isinstance(required, Scalar) and not is_true(required.value)
            yield EnvFile(path.text, path.span, not optional)


def cid_variables(files: Iterable[EnvFile], folder: Path) -> tuple[str, ...]:
    """The CID variables that files beside the compose file set."""
    found: set[str] = set()
    for file in files:
        if not file.path.startswith(("/", "~", "$")):
            found |= set(variables_of(folder / file.path))
    return tuple(v for v in CID_VARIABLES if v in found)
