"""Mounts within folders to which a service may write: it could put a link in their place, which the engine follows."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dodo_dsl.application import host_access
from dodo_dsl.application.access import filled
from dodo_dsl.application.access.access_diagnostics import diagnostic
from dodo_dsl.application.access.host_paths import HostPaths, real
from dodo_dsl.application.access.model import AccessFinding, Steps
from dodo_dsl.application.model import ApplicationSource, plain
from dodo_dsl.diagnostics import Diagnostic, Span
from dodo_dsl.source import Mapping, Node


@dataclass(frozen=True)
class Shown:
    """A path of the host that the engine mounts; ``steps`` lead to it in ``node``; ``writer`` may be empty.

    ``is_required`` tells that the engine does not make what is missing.
    """

    node: Node
    span: Span
    steps: Steps
    source: str
    writer: str = ""
    is_required: bool = False


def nested_mounts(application: ApplicationSource) -> Iterator[Diagnostic]:
    """Mounts, bound volumes, secrets and configs that lie in a folder to which a service may write."""
    paths, every = application.paths, list(shown_paths(application))
    sources = [(shown.source, shown.writer) for shown in every if not paths.is_open(shown.source)]
    for shown in every:
        if problem := within_another(shown.source, sources, paths):
            yield diagnostic(AccessFinding(shown.steps, *problem), shown.node, shown.span)


def within_another(source: str, mounts: Sequence[tuple[str, str]], paths: HostPaths) -> tuple[str, str] | None:
    """Why a path is no mount beside the others, each with who writes to it or an empty string, and what to do."""
    if paths.is_open(source):
        return None
    for other, writer in mounts:
        outer = Path(paths.names(other)[-1])
        if writer and paths.is_writable(other) and any(outer in place.parents for place in _places(source, paths)):
            message = f"'{source}' lies in '{outer}', where '{writer}' could put a link in its place"
            return message, f"mount '{outer}' in both, or read-only (:ro)"
    return None


def shown_paths(application: ApplicationSource) -> Iterator[Shown]:
    """What the services mount of the host, and what their volumes, secrets and configs show of it."""
    services = {s.name: plain(filled.node(s.node, application.known)) for s in application.services.values()}
    every = [*_of_services(application, services), *_of_rest(application, services)]
    yield from (shown for shown in every if shown.source)


def _of_services(application: ApplicationSource, services: dict[str, dict[str, Any]]) -> Iterator[Shown]:
    for name, item, volume in _volumes(services):
        seen, service = host_access.mount(volume), application.services[name]
        if host_access.is_bind(volume, seen.source) and not host_access.is_token(seen):
            writer = "" if seen.read_only else name
            bind = volume.get("bind") if isinstance(volume, dict) else None
            is_required = isinstance(bind, dict) and bind.get("create_host_path") is False
            yield Shown(service.node, service.span, ("volumes", item), seen.source, writer, is_required)


def _of_rest(application: ApplicationSource, services: dict[str, dict[str, Any]]) -> Iterator[Shown]:
    writers = {m.source: n for n, _, v in _volumes(services) if not (m := host_access.mount(v)).read_only}
    for key in ("volumes", "secrets", "configs"):
        node = application.rest.get(key)
        if not isinstance(node, Mapping):
            continue
        for name, about in plain(filled.node(node, application.known)).items():
            if host_access.is_bound(about) or "$" in "".join(host_access.volume_options(about)):
                writer = "" if host_access.is_read_only(about) else writers.get(name, "")
                device = str(about["driver_opts"].get("device") or "")
                yield Shown(node, node.span, (name, "driver_opts", "device"), device, writer)
            elif isinstance(about, dict) and isinstance(about.get("file"), str):
                yield Shown(node, node.span, (name, "file"), about["file"])


def _volumes(services: dict[str, dict[str, Any]]) -> Iterator[tuple[str, int, Any]]:
    """Every entry of ``volumes``, with its service and its number."""
    for name, service in services.items():
        written = service.get("volumes")
        for item, volume in enumerate(written if isinstance(written, list) else ()):
            yield name, item, volume


def _places(source: str, paths: HostPaths) -> Iterator[Path]:
    """Where the path is, and each of its parts, any of which may be a link."""
    yield from map(Path, paths.names(source))
    whole = Path(paths.whole(source))
    yield from (Path(real(place.parent)) / place.name for place in (whole, *whole.parents))
