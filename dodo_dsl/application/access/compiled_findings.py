"""A compiled test as the engine would see it: what its services may not have, and no rule of a test has removed."""

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from dodo_dsl.application import host_access
from dodo_dsl.application.access.build_findings import short_name
from dodo_dsl.application.access.host_paths import HostPaths
from dodo_dsl.application.access.limit_findings import volume_findings
from dodo_dsl.application.access.model import Access, AccessFinding, Steps
from dodo_dsl.application.access.mount_findings import mount_findings
from dodo_dsl.application.access.service_findings import Surroundings, service_findings
from dodo_dsl.application.access.shared_findings import OWN_VOLUMES, shared_findings
from dodo_dsl.application.model import FILES
from dodo_dsl.application.nested_mounts import within_another
from dodo_dsl.spec.deployment.sandbox_limits import SandboxLimits

_SERVICES = "services"
_DRIVERS = ("json-file", "local", "")


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
    rest = {key: value for key, value in config.items() if key != _SERVICES}
    yield from shared_findings(rest, test.paths, test.access.passed, compiled=True)
    volumes = rest.get("volumes") or {}
    others = {name: about for name, about in volumes.items() if name not in OWN_VOLUMES}
    yield from volume_findings(others, test.limits, compiled=True)
    yield from _written(others, test.paths)
    yield from _nested(config, test)
    around = Surroundings(test.paths, {}, volumes, compiled=True, ports=test.access.ports, limits=test.limits)
    for name, service in config.get(_SERVICES, {}).items():
        if name in test.application:
            every = [*service_findings(name, service, around), *_of_others(name, service, test)]
            yield from (f.below(_SERVICES, name) for f in every if not _is_allowed(f, test.access))
        elif name == FILES:
            mounts = mount_findings(name, service, test.paths, volumes, test.access.ports, compiled=True)
            yield from (f.below(_SERVICES, name) for f in mounts)
        elif name not in test.own:
            yield AccessFinding((_SERVICES, name), f"the test has no service '{name}'")


def _written(volumes: Mapping[str, Any], paths: HostPaths) -> Iterator[AccessFinding]:
    """Volumes that are folders of the host, and could be written to although dodo.yml does not name them."""
    for name, about in volumes.items():
        options = about.get("driver_opts") if host_access.is_bound(about) else {}
        device = str(options.get("device") or "")
        if device and not host_access.is_read_only(about) and not paths.is_writable(device):
            yield AccessFinding(("volumes", name, "driver_opts", "o"), f"'{device}' is mounted to be written to")


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


def _is_allowed(finding: AccessFinding, access: Access) -> bool:
    if finding.kind == "hardware":
        return access.devices
    return finding.kind in ("privilege", "left out") and access.devices and access.privileged


def _of_others(name: str, service: Mapping[str, Any], test: CompiledTest) -> Iterator[AccessFinding]:
    """What the copy has otherwise: the test's own network and memory, and logs that DoDo reads."""
    for key in ("network_mode", "ipc") if test.own_network else ():
        mode = str(service.get(key) or "")
        if mode in ("host", "bridge") or host_access.reference(mode)[0] == "container":
            yield AccessFinding((key,), f"'{mode}' of '{name}' is not the test's own")
    logging = service.get("logging")
    driver = str(logging.get("driver") or "") if isinstance(logging, dict) else ""
    if driver not in _DRIVERS:
        yield AccessFinding(("logging", "driver"), f"DoDo cannot read logs of '{driver}'")
    ours = {short_name(image) for image in test.images}
    if service.get("build") is not None and short_name(str(service.get("image"))) in ours:
        yield AccessFinding(("image",), f"the image '{service['image']}' of '{name}' would replace one of DoDo's own")


def shown(steps: Steps) -> str:
    """The steps as people write them: ``services.driver.volumes[0]``."""
    return "".join(f"[{step}]" if isinstance(step, int) else f".{step}" for step in steps).removeprefix(".")
