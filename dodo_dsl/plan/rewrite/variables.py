"""The variables of the application's own ``.env`` that a compiled test carries."""

from collections.abc import Iterable, Iterator

from dodo_dsl import source
from dodo_dsl.application import compose_paths, interpolation, opendlv_flags
from dodo_dsl.application.access.secret_variables import is_steering
from dodo_dsl.application.compose_files import text_of
from dodo_dsl.application.model import ApplicationSource
from dodo_dsl.source import Node, Scalar


def carried(application: ApplicationSource, cid: int, base: str, path_variables: set[str]) -> dict[str, str]:
    """Those that it uses and that are no secrets, with the test's CID, and paths relative to the test."""
    found = {}
    for name in _used(application):
        if is_steering(name) or name in application.secrets:
            continue
        value = application.variables[name]
        is_path = name in path_variables and (value in (".", "..") or value.startswith(("./", "../")))
        found[name] = compose_paths.rebased(value, base) if is_path else value
    return {**found, **{name: str(cid) for name in opendlv_flags.CID_VARIABLES if name in found}}


def _used(application: ApplicationSource) -> list[str]:
    """The variables that compose fills in anywhere, in the order of their files."""
    services = application.services.values()
    used = set(opendlv_flags.CID_VARIABLES)
    for node in (*(service.node for service in services), *application.rest.values()):
        used.update(_named(node))
    for path in {file.path for service in services for file in service.env_files}:
        used |= interpolation.names(text_of(application.folder / path))
    before: set[str] = set()
    while before != used:
        before = set(used)
        used.update(*(interpolation.names(application.variables.get(name, "")) for name in before))
    return [name for name in application.variables if name in used]


def _named(node: Node) -> Iterator[str]:
    """Variables in strings, and names without a value, which take it from the variable of that name."""
    for part in source.walk(node):
        if isinstance(part, Scalar):
            yield from interpolation.names(part.text)
            yield part.text
        elif isinstance(part, source.Mapping):
            yield from _without_value(part.entries.items())


def _without_value(entries: Iterable[tuple[str, source.Entry]]) -> Iterator[str]:
    yield from (key for key, entry in entries if isinstance(entry.value, Scalar) and entry.value.value is None)
