"""What the engine mounts of the host for an application: nested, missing, too large to be copied, or of tests.

In a folder to which a service may write, it could put a link in the place of another mount, which the engine follows.
No application sees the repository's tests, their output and ``.git``.
"""

import functools
import os
import stat
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from dodo_dsl.application import host_access
from dodo_dsl.application.access.host_paths import HostPaths, real
from dodo_dsl.application.access.model import AccessFinding, Steps, diagnostic, place
from dodo_dsl.application.access.value_findings import is_remote
from dodo_dsl.application.interpolation import interpolated_node
from dodo_dsl.application.model import ApplicationSource, plain
from dodo_dsl.diagnostics import Diagnostic, Span
from dodo_dsl.source import Mapping, Node, Scalar
from dodo_dsl.spec.deployment import Deployment
from dodo_dsl.spec.sandbox_limits import SandboxLimits

WAY_OUT = "mount it read-only (:ro), name it under 'paths' in dodo.yml, or raise '{key}' in 'sandbox' there"
_MB = 10**6


@dataclass(frozen=True)
class Shown:
    """A path of the host that the engine mounts; ``steps`` lead to it in ``node``; ``writer`` may be empty.

    ``is_required`` means that the engine does not make what is missing.
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
    """Why a path cannot be mounted with the others, each with the service that writes to it or empty, and a hint."""
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
    services = {s.name: plain(interpolated_node(s.node, application.known)) for s in application.services.values()}
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
        for name, about in plain(interpolated_node(node, application.known)).items():
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


def missing_folders(application: ApplicationSource) -> Iterator[Diagnostic]:
    """Mounts of what is missing and must not be created; other missing folders are empty ones of the test."""
    for shown in _of_repository(application):
        if shown.is_required and not os.path.lexists(application.paths.whole(shown.source)):
            message = f"there is no file or folder '{shown.source}', and 'create_host_path: false' requires it"
            yield _problem(shown, message, "create it, or remove 'create_host_path'; paths are relative to this file")


def large_folders(application: ApplicationSource, hidden: Collection[Path]) -> Iterator[Diagnostic]:
    """The folder with which a test's copies are beyond their limits; of the ``hidden`` ones there are none."""
    limits, files, size = application.limits, 0, 0
    unseen = frozenset(str(path) for path in (*hidden, *(root / ".git" for root in application.paths.roots)))
    for folder, shown in _copied(application).items():
        own_files, own_size = measured(folder, unseen, limits.copied_files, Path(folder).stat().st_mtime_ns)
        files, size = files + own_files, size + own_size
        if problem := too_much(shown.source, (own_files, files), (own_size, size), limits):
            yield replace(_problem(shown, *problem), severity="warning")
            return


def too_much(
    source: str, files: tuple[int, int], size: tuple[int, int], limits: SandboxLimits
) -> tuple[str, str] | None:
    """Why a folder is not copied, and what to do; of ``files`` and bytes, its own and with those copied before."""
    if files[1] > limits.copied_files:
        own = f"more than {limits.copied_files}" if files[0] > limits.copied_files else str(files[0])
        message = f"'{source}' holds {own} files, and the copies of a test may hold {limits.copied_files}"
        return message, WAY_OUT.format(key="copied-files")
    if size[1] > limits.copies:
        message = f"'{source}' holds {size[0] // _MB} MB, and the copies of a test may hold {limits.copies // _MB} MB"
        return message, WAY_OUT.format(key="copies")
    return None


def _problem(shown: Shown, message: str, hint: str) -> Diagnostic:
    return Diagnostic(place(shown.node, shown.steps, shown.span), "application-file", message, hint)


def _of_repository(application: ApplicationSource) -> Iterator[Shown]:
    """The mounts of services that show a path of the repository."""
    paths = application.paths
    for shown in shown_paths(application):
        is_mount = shown.steps[0] == "volumes" and not paths.is_open(shown.source)
        if is_mount and paths.is_own(shown.source) and paths.is_of_repository(shown.source):
            yield shown


def _copied(application: ApplicationSource) -> dict[str, Shown]:
    """The mounts that tests copy, by the real path of their folder."""
    paths: HostPaths = application.paths
    found: dict[str, Shown] = {}
    for shown in _of_repository(application):
        folder = paths.names(shown.source)[-1]
        if shown.writer and not paths.is_writable(shown.source) and Path(folder).is_dir():
            found.setdefault(folder, shown)
    return found


@functools.lru_cache(maxsize=64)
def measured(folder: str, hidden: frozenset[str], most_files: int, _changed_ns: int) -> tuple[int, int]:
    """Files and folders below one, and their sizes in bytes; no more of them are counted than one beyond the most."""
    files, size, left = 0, 0, [folder]
    while left and files <= most_files:
        try:
            with os.scandir(left.pop()) as entries:
                for entry in entries:
                    about = entry.stat(follow_symlinks=False)
                    files, size = files + 1, size + about.st_size
                    if stat.S_ISDIR(about.st_mode) and entry.path not in hidden:
                        left.append(entry.path)
        except OSError:
            continue
    return files, size


_OUTPUT = ("generated", "dodo-report")


def unseen_folders(application: ApplicationSource, deployment: Deployment, others: Collection[Path] = ()) -> list[Path]:
    """What no application sees: folders with tests and own services, ``.git``, compiled tests and reports by default.

    A registry, or one of the ``others``, that is the application's own folder, or above it, is none of them.
    """
    own = application.folder.resolve()
    found = {Path(os.path.realpath(folder)) for folder in (*deployment.registry, *deployment.services, *others)}
    roots = {Path(os.path.realpath(root)) for root in (*application.paths.roots, deployment.root, own)}
    made = {root / name for root in roots for name in (".git", *_OUTPUT)}
    return sorted({path for path in found if not own.is_relative_to(path)} | made)


def unseen_problems(
    application: ApplicationSource, deployment: Deployment, registries: Collection[Path]
) -> Iterator[Diagnostic]:
    """Mounts, configs, secrets, files of variables and builds' contexts in a folder that no application sees."""
    hidden = unseen_folders(application, deployment, registries)
    for source, span in _asked_for(application):
        if application.paths.is_open(source) or application.paths.is_writable(source):
            continue
        names = map(Path, application.paths.names(source))
        if holder := next((h for name in names for h in hidden if name.is_relative_to(h)), None):
            what = f"'{holder.name}', {_reason(holder)}"
            message = f"'{source}' lies in {what}, which no application sees"
            yield Diagnostic(span, "application-isolation", message, "keep what it needs in another folder")


def _reason(holder: Path) -> str:
    reasons = {".git": "where Git keeps its own", "generated": "the compiled tests", "dodo-report": "the report"}
    return reasons.get(holder.name, "a folder of tests or of DoDo's services")


def _asked_for(application: ApplicationSource) -> Iterator[tuple[str, Span]]:
    for shown in shown_paths(application):
        yield shown.source, place(shown.node, shown.steps, shown.span)
    for service in application.services.values():
        yield from ((file.path, file.span) for file in service.env_files)
        build = service.node.get("build")
        context = build.get("context") if isinstance(build, Mapping) else build
        text = context.value if isinstance(context, Scalar) else None
        if context and isinstance(text, str) and not is_remote(text, application.paths):
            yield text, context.span
