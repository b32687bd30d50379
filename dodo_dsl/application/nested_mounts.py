"""Mounts within folders to which a service may write: it could put a link in their place, which the engine follows."""

from collections.abc import Iterator
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
class _Shown:
    """A path of the host that the engine mounts; ``steps`` lead to it in ``node``; ``writer`` may be empty."""

    node: Node
    span: Span
    steps: Steps
    source: str
    writer: str = ""


def nested_mounts(application: ApplicationSource) -> Iterator[Diagnostic]:
    """Mounts, bound volumes, secrets and configs that lie in a folder to which a service may write."""
    paths = application.paths
    services = {s.name: plain(filled.node(s.node, application.known)) for s in application.services.values()}
    every = [*_of_services(application, services), *_of_rest(application, services)]
    every = [shown for shown in every if shown.source and not paths.is_open(shown.source)]
    open_to = {Path(paths.names(s.source)[-1]): s.writer for s in every if s.writer and paths.is_writable(s.source)}
    for shown in every:
        for outer, writer in open_to.items():
            if any(outer in place.parents for place in _places(shown.source, paths)):
                message = f"'{shown.source}' lies in '{outer}', where '{writer}' could put a link in its place"
                finding = AccessFinding(shown.steps, message, f"mount '{outer}' in both, or read-only (:ro)")
                yield diagnostic(finding, shown.node, shown.span)
                break


def _of_services(application: ApplicationSource, services: dict[str, dict[str, Any]]) -> Iterator[_Shown]:
    for name, item, volume in _volumes(services):
        seen, service = host_access.mount(volume), application.services[name]
        if host_access.is_bind(volume, seen.source) and not host_access.is_token(seen):
            writer = "" if seen.read_only else name
            yield _Shown(service.node, service.span, ("volumes", item), seen.source, writer)


def _of_rest(application: ApplicationSource, services: dict[str, dict[str, Any]]) -> Iterator[_Shown]:
    writers = {m.source: n for n, _, v in _volumes(services) if not (m := host_access.mount(v)).read_only}
    for key in ("volumes", "secrets", "configs"):
        node = application.rest.get(key)
        if not isinstance(node, Mapping):
            continue
        for name, about in plain(filled.node(node, application.known)).items():
            if host_access.is_bound(about) or "$" in "".join(host_access.volume_options(about)):
                writer = "" if host_access.is_read_only(about) else writers.get(name, "")
                device = str(about["driver_opts"].get("device") or "")
                yield _Shown(node, node.span, (name, "driver_opts", "device"), device, writer)
            elif isinstance(about, dict) and isinstance(about.get("file"), str):
                yield _Shown(node, node.span, (name, "file"), about["file"])


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
