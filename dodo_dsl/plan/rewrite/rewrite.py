"""``plan_application``: a test's own copy of the application's compose file."""

import os
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

from dodo_dsl.application import compose_paths, host_access, interpolation, opendlv_flags
from dodo_dsl.application.model import KEYS, ApplicationSource, ComposeService, Word, environment, plain, text
from dodo_dsl.application.test_variables import with_variables
from dodo_dsl.plan.model import STARTED, Application, ApplicationService
from dodo_dsl.plan.rewrite import (
    cid_and_image,
    container_limits,
    other_changes,
    removals,
    service_namespaces,
    variables,
    volumes,
)
from dodo_dsl.plan.rewrite.file_copies import FileCopies
from dodo_dsl.plan.rewrite.service_copy import ServiceCopy, Setting
from dodo_dsl.source import Node
from dodo_dsl.spec.deployment.sandbox_limits import SandboxLimits

_STEPS: tuple[Callable[[ServiceCopy], None], ...] = (
    cid_and_image.assign_image,
    removals.remove_machine_settings,
    removals.remove_hardware,
    container_limits.confine,
    service_namespaces.own_namespaces,
    volumes.own_mounts,
    service_namespaces.own_dependencies,
)


def plan_application(
    application: ApplicationSource,
    cid: int,
    isolation: str,
    folder: Path,
    after: tuple[str, ...],
    *,
    hil: bool = False,
    privileged_allowed: bool = False,
    limits: SandboxLimits = SandboxLimits(),  # noqa: B008  (it is frozen)
    given: Mapping[str, str] = MappingProxyType({}),
) -> Application:
    """The application as a test runs it; ``folder`` is the compiled test's, ``after`` the services it waits for.

    Devices stay only with ``hil``, privileges only with ``privileged_allowed`` as well. ``given`` are variables
    that the test sets.
    """
    application = with_variables(application, given)
    base = _relative(application.folder, folder)
    written = compose_paths.escaped(base)
    names = frozenset(application.services)
    containers, known, ports = application.containers, application.known, application.access.ports
    changes = [f"{name}: left out, {why}" for name, why in application.dropped.items()]
    changes += [f"all services: {name} as the test sets it" for name in given]
    path_variables: set[str] = set()

    def change(path: str) -> str:
        path_variables.update(interpolation.names(path) if path.startswith("$") else ())
        return compose_paths.rebased(path, written)

    nodes = {n: compose_paths.mapped_service(service.node, change) for n, service in application.services.items()}
    rest = {key: plain(node) for key, node in compose_paths.mapped_rest(application.rest, change).items()}
    paths = replace(application.paths, folder=folder)
    copies = FileCopies(paths, known, map(plain, nodes.values()), rest.get("volumes"))
    setting = Setting(cid, isolation, after, names, containers, hil, privileged_allowed, known, limits, ports, copies)
    services = {name: _copied(application.services[name], node, setting, changes) for name, node in nodes.items()}
    for key in ("secrets", "configs"):
        if isinstance(rest.get(key), dict):
            rest[key] = {name: volumes.without_name(about) for name, about in rest[key].items()}
    changes = other_changes.of_all(changes, list(services))
    if "volumes" in rest or copies.sources:
        rest["volumes"] = volumes.own_volumes(rest.get("volumes"), changes, copies.sources, limits, known, paths)
    changes += other_changes.of_top_level(application, rest)
    planned = tuple(_planned(service, cid, application) for service in application.services.values())
    carried = variables.carried(application, cid, base, path_variables)
    secrets = {name: _relative(file, folder) for name, file in application.secrets.items()}
    access = replace(
        application.access,
        roots=tuple(_relative(root, folder) for root in application.other_roots),
        devices=hil,
        privileged=hil and privileged_allowed,
    )
    compose = {"services": services, **rest}
    return Application(
        base, planned, compose, tuple(changes), carried, limits, secrets=secrets, access=access, copies=copies.sources
    )


def _relative(path: Path, folder: Path) -> str:
    return Path(os.path.relpath(path, folder)).as_posix()


def _copied(service: ComposeService, node: Node, setting: Setting, changes: list[str]) -> dict[str, Any]:
    """The service rewritten, without keys that have no value, most of which compose refuses."""
    kept = {key: value for key, value in _with_values(plain(node)).items() if key not in KEYS}
    copy = ServiceCopy(service.name, kept, setting, changes)
    cid_and_image.assign_cid(copy, service.cid_variables)
    for step in _STEPS:
        step(copy)
    other_changes.note_others(copy, _with_values(plain(service.node)), _with_values(plain(node)))
    return copy.service


def _with_values(service: Mapping[str, Any]) -> dict[str, Any]:
    kept = {key: value for key, value in service.items() if value is not None}
    if isinstance(build := kept.get("build"), dict):
        kept["build"] = {key: value for key, value in build.items() if value is not None}
    return kept


def _planned(service: ComposeService, cid: int, application: ApplicationSource) -> ApplicationService:
    """The service as it starts without containers."""
    raw = plain(service.node)
    written = raw.get("command")
    command = opendlv_flags.split(written) if isinstance(written, str) else tuple(text(word) for word in written or ())
    variables = {
        k: opendlv_flags.with_cid_text(v, cid) if v else v for k, v in environment(raw.get("environment")).items()
    }
    for name in opendlv_flags.CID_VARIABLES:
        if name in variables or name in service.cid_variables:
            variables[name] = str(cid)
    process = raw.get("x-dodo-process")
    words = (*(process or ()), *command)
    return ApplicationService(
        name=service.name,
        process=tuple(str(w) for w in process) if process else None,
        command=opendlv_flags.with_cid(command, cid),
        environment=variables,
        takes_cid=opendlv_flags.takes_cid((*words, *(v for v in variables.values() if v)), variables),
        takes_memory=opendlv_flags.takes_memory(words),
        env_files=tuple(file.path for file in service.env_files),
        inputs=_names(service.declared.inputs) if service.declared else (),
        outputs=_names(service.declared.outputs) if service.declared else (),
        after=(after := _after(raw, application)),
        optional=_optional(raw, after),
    )


def _after(service: dict[str, Any], application: ApplicationSource) -> dict[str, str]:
    """The services that start before this one, each with its condition: also those whose namespaces it joins."""
    needed = [name for _, name in host_access.references(service, dict(application.containers))]
    about = service.get("depends_on")
    written = {str(n): _condition(how) for n, how in about.items()} if isinstance(about, dict) else {}
    every = {**dict.fromkeys(needed, STARTED), **written}
    return {name: condition for name, condition in every.items() if name in application.services}


def _optional(service: dict[str, Any], after: Iterable[str]) -> tuple[str, ...]:
    about = service.get("depends_on")
    written = about if isinstance(about, dict) else {}
    return tuple(n for n in after if isinstance(written.get(n), dict) and written[n].get("required") is False)


def _condition(about: Any) -> str:
    """A condition of ``depends_on``; one of a variable without a value is only that the service has started."""
    condition = str((about.get("condition") if isinstance(about, dict) else "") or STARTED)
    return STARTED if "$" in condition else condition


def _names(words: Iterable[Word]) -> tuple[str, ...]:
    return tuple(name for name, _ in words)
