"""What is found in compose files by the tables of ``compose_keys``: in written ones, and in a compiled test.

A compiled test is seen as the engine would see it, so that a variable's value is judged before anything is created.
"""

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from dodo_dsl.application import host_access
from dodo_dsl.application.access import value_findings
from dodo_dsl.application.access.compose_keys import BELOW, SERVICE, SHARED, TOP
from dodo_dsl.application.access.host_paths import HostPaths
from dodo_dsl.application.access.model import Access, AccessFinding, Look, Steps, mapping_findings, mappings
from dodo_dsl.application.access.value_findings import OWN_VOLUMES
from dodo_dsl.application.model import FILES
from dodo_dsl.application.mounts import within_another
from dodo_dsl.spec.sandbox_limits import SandboxLimits

_SERVICES = "services"
_CALLED = {"": "'{name}'", "build": "the build of '{name}'", "volumes.*": "a mount of '{name}'"}
_OF_SERVICES = {"image", "build", "command", "x-dodo", "x-dodo-process"}
_LOWER = "blkio_config"
"""Compose shows the keys below it in capitals."""


def service_findings(name: str, service: Mapping[str, Any], look: Look) -> Iterator[AccessFinding]:
    """Everything that a service may not have, in its plain values; ``name`` is how messages call it."""
    look = replace(look, name=name)
    for path, rows in {"": SERVICE, **BELOW}.items():
        for steps, written in mappings(service, path):
            dotted = ".".join(step for step in steps if isinstance(step, str))
            what = _CALLED.get(path, "'{dotted}' of '{name}'").format(name=name, dotted=dotted)
            is_capital = look.compiled and path.startswith(_LOWER)
            seen = {str(key).lower(): value for key, value in written.items()} if is_capital else written
            yield from (f.below(*steps) for f in mapping_findings(what, rows, seen, look))


def shared_findings(document: Mapping[str, Any], look: Look) -> Iterator[AccessFinding]:
    """Everything except the services, in the file's other keys; in a compiled test compose names all."""
    for finding in mapping_findings("the compose file", TOP, document, replace(look, compiled=False)):
        about = document.get(str(finding.steps[0])) if finding.kind == "unknown" else None
        is_service = isinstance(about, dict) and about.keys() & _OF_SERVICES
        yield replace(finding, hint="indent it by 2: it looks like a service", fix=None) if is_service else finding
    for key, table in SHARED.items():
        is_compiled = look.compiled and key != "networks"  # the network is DoDo's
        for (name,), about in mappings(document.get(key), "*"):
            own = replace(look, name=str(name), what=f"the {key.removesuffix('s')}", compiled=is_compiled)
            gone = {word for word, row in table.items() if row.treatment == "removed"} if look.compiled else set()
            ours = gone if name in OWN_VOLUMES else gone & {"name"}  # compose names all
            rows = {**table, **{word: table[word]._replace(treatment="kept") for word in ours}}
            found = mapping_findings(f"{own.what} '{name}'", rows, about, own)
            yield from (f.below(key, name) for f in found)


@dataclass(frozen=True)
class CompiledTest:
    """``application`` and ``own`` are the names of its services and of DoDo's; ``images`` are those of DoDo."""

    application: Collection[str]
    own: Collection[str]
    images: Collection[str]
    own_network: bool
    access: Access
    paths: HostPaths
    limits: SandboxLimits = field(default_factory=SandboxLimits)


def compiled_findings(config: Mapping[str, Any], test: CompiledTest) -> Iterator[AccessFinding]:
    """Findings in what ``docker compose config --format json`` prints, each of which refuses the test."""
    access, volumes = test.access, config.get("volumes") or {}
    look = Look(
        test.paths, volumes=volumes, ports=access.ports, limits=test.limits, passed=access.passed, compiled=True,
        images=test.images, own_network=test.own_network,
    )  # fmt: skip
    yield from shared_findings({key: value for key, value in config.items() if key != _SERVICES}, look)
    yield from _nested(config, test)
    for name, service in config.get(_SERVICES, {}).items():
        if name in test.application:
            every = service_findings(name, service, look)
            yield from (f.below(_SERVICES, name) for f in every if not access.allows(f.kind))
        elif name == FILES:
            found = value_findings.mounts(service, replace(look, name=name))
            yield from (f.below(_SERVICES, name) for f in found)
        elif name not in test.own:
            yield AccessFinding((_SERVICES, name), f"the test has no service '{name}'")


def _nested(config: Mapping[str, Any], test: CompiledTest) -> Iterator[AccessFinding]:
    """Mounts within folders to which a service may write, whatever variables have made of them."""
    volumes = config.get("volumes") or {}
    mounts: list[tuple[Steps, str, str]] = []
    for name, service in config.get(_SERVICES, {}).items():
        if name not in test.application and name != FILES:
            continue
        for item, volume in enumerate(service.get("volumes") or ()):
            shown = volume if isinstance(volume, dict) else {}
            found, about = host_access.mount(volume), volumes.get(str(shown.get("source"))) or {}
            is_bound = shown.get("type") == "volume" and host_access.is_bound(about)
            source = str(about["driver_opts"].get("device") or "") if is_bound else found.source
            if is_bound or shown.get("type") == "bind":
                is_read = found.read_only or (is_bound and host_access.is_read_only(about))
                mounts.append(((_SERVICES, name, "volumes", item, "source"), source, "" if is_read else name))
    for key in ("secrets", "configs"):
        files = {n: each.get("file") for n, each in (config.get(key) or {}).items() if isinstance(each, dict)}
        mounts += [((key, name, "file"), str(file), "") for name, file in files.items() if file]
    every = [(source, writer) for _, source, writer in mounts]
    for steps, source, _ in mounts:
        if problem := within_another(source, every, test.paths):
            yield AccessFinding(steps, *problem)
