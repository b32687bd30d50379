"""``plan_application``: a test's own copy of the application's compose file."""

import os
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from dodo_dsl import source
from dodo_dsl.application import compose_paths, host_access, interpolation, opendlv_flags
from dodo_dsl.application.access.model import Look
from dodo_dsl.application.access.secret_variables import is_steering
from dodo_dsl.application.compose_files import text_of
from dodo_dsl.application.model import KEYS, ApplicationSource, ComposeService, Word, environment, plain, text
from dodo_dsl.application.variables import with_variables
from dodo_dsl.plan.model import DISPLAY_SERVER, STARTED, Application, ApplicationService, Line
from dodo_dsl.plan.rewrite import confinement, service_copy, service_namespaces, volumes
from dodo_dsl.plan.rewrite.service_copy import ComposeProject, ServiceCopy, Setting
from dodo_dsl.source import Node, Scalar

_STEPS: tuple[Callable[[ServiceCopy], None], ...] = (
    service_copy.assign_image,
    service_copy.draw_nowhere,
    confinement.remove_machine_settings,
    confinement.remove_hardware,
    confinement.confine,
    service_namespaces.own_namespaces,
    volumes.own_mounts,
    service_namespaces.own_time,
    service_namespaces.own_dependencies,
)


def plan_application(application: ApplicationSource, setting: Setting) -> Application:
    """The application as a test runs it."""
    application = with_variables(application, dict(setting.given))
    base = _relative(application.folder, setting.folder)
    written = compose_paths.escaped(base)
    changes = [f"{name}: left out, {why}" for name, why in application.dropped.items()]
    changes += [f"all services: {name} as the test sets it" for name, _ in setting.given]
    path_variables: set[str] = set()

    def change(path: str) -> str:
        path_variables.update(interpolation.names(path) if path.startswith("$") else ())
        return compose_paths.rebased(path, written)

    nodes = {n: compose_paths.mapped_service(service.node, change) for n, service in application.services.items()}
    rest = {key: plain(node) for key, node in compose_paths.mapped_rest(application.rest, change).items()}
    project = _project(application, setting, map(plain, nodes.values()), rest.get("volumes"))
    services = {name: _copied(application.services[name], node, project, changes) for name, node in nodes.items()}
    for key in ("secrets", "configs"):
        if isinstance(rest.get(key), dict):
            rest[key] = {name: volumes.without_name(about) for name, about in rest[key].items()}
    changes = _with_common(changes, list(services))
    copies = project.copies.sources if project.copies else {}
    if "volumes" in rest or copies:
        rest["volumes"] = volumes.own_volumes(rest.get("volumes"), changes, project)
    changes += _of_top_level(application, rest)
    access = replace(
        application.access,
        roots=tuple(_relative(root, setting.folder) for root in application.other_roots),
        devices=setting.hil,
        privileged=setting.keeps_privileges,
    )
    return Application(
        base,
        tuple(_planned(service, setting.cid, application) for service in application.services.values()),
        {"services": services, **rest},
        tuple(changes),
        carried(application, setting.cid, base, path_variables),
        setting.limits,
        secrets={name: _relative(file, setting.folder) for name, file in application.secrets.items()},
        access=access,
        copies=copies,
    )


def _project(application: ApplicationSource, setting: Setting, services: Iterable[Any], named: Any) -> ComposeProject:
    """What the copies of the services share; their paths and those of the ``named`` volumes are as the copies have."""
    paths = replace(application.paths, folder=setting.folder)
    access = application.access
    look = Look(
        paths, containers=application.containers, ports=access.ports, limits=setting.limits, passed=access.passed
    )
    copies = volumes.FileCopies(paths, application.known, services, named)
    return ComposeProject(setting, tuple(application.services), look, application.known, copies)


def _relative(path: Path, folder: Path) -> str:
    return Path(os.path.relpath(path, folder)).as_posix()


def _copied(service: ComposeService, node: Node, project: ComposeProject, changes: list[str]) -> dict[str, Any]:
    """The service rewritten, without keys that have no value, most of which compose refuses."""
    kept = {key: value for key, value in _with_values(plain(node)).items() if key not in KEYS}
    copy = ServiceCopy(service.name, kept, project, changes)
    service_copy.assign_cid(copy, service.cid_variables)
    for step in _STEPS:
        step(copy)
    if service.declared and service.declared.lines and copy.service.get("tty") is not True:
        copy.service["tty"] = True
        copy.note("tty: true, as programs print each line at once to a terminal")
    _note_others(copy, _with_values(plain(service.node)), _with_values(plain(node)))
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
    process, own = raw.get("x-dodo-process"), service.declared
    command = opendlv_flags.arguments(list(map(str, process or ())), command)
    words = (*(process or ()), *command)
    return ApplicationService(
        name=service.name,
        process=(*(DISPLAY_SERVER if service.has_display else ()), *map(str, process)) if process else None,
        command=opendlv_flags.with_cid(command, cid),
        environment=variables,
        takes_cid=opendlv_flags.takes_cid((*words, *(v for v in variables.values() if v)), variables),
        takes_memory=opendlv_flags.takes_memory(words),
        env_files=tuple(file.path for file in service.env_files),
        raw_files=tuple(file.path for file in service.env_files if file.raw),
        inputs=_names(own.inputs) if own else (),
        outputs=_names(own.outputs) if own else (),
        after=(after := _after(raw, application)),
        optional=_optional(raw, after),
        lines=tuple(Line(line.match, line.message, line.sender) for line in own.lines) if own else (),
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


def _note_others(copy: ServiceCopy, written: Mapping[str, Any], with_paths: Mapping[str, Any]) -> None:
    """Notes each key that differs from the file and that no change of the service names.

    ``written`` is the service as in the file, ``with_paths`` the same with paths as seen from the test's folder.
    """
    if moved := [key for key, value in with_paths.items() if written.get(key) != value]:
        copy.note(f"paths start at this folder: {', '.join(sorted(moved))}")
    noted = [line for line in copy.changes if line.startswith(f"{copy.name}: ")]
    for words, keys in (
        ("changed for the test", [key for key, value in copy.service.items() if with_paths.get(key, value) != value]),
        ("added for the test", [key for key in copy.service if key not in with_paths]),
        ("left out", [key for key in with_paths if key not in copy.service]),
    ):
        if unnamed := sorted(key for key in keys if not _is_named(key, noted)):
            copy.note(f"{words}: {', '.join(unnamed)}")


def _of_top_level(application: ApplicationSource, rest: Mapping[str, Any]) -> Iterator[str]:
    """Of the file's keys other than ``services``: ``rest`` is what the copy has of them."""
    changed = [key for key, node in application.rest.items() if rest[key] != plain(node)]
    for words, keys in (("changed for the test", changed), ("left out", application.left_out)):
        if keys:
            yield f"{words}: {', '.join(sorted(keys))}"


def _with_common(changes: Sequence[str], names: Sequence[str]) -> list[str]:
    """The changes, where those that all of several services have are one each, after the others."""
    texts = {
        name: [line.removeprefix(f"{name}: ") for line in changes if line.startswith(f"{name}: ")] for name in names
    }
    common = (
        [text for text in texts[names[0]] if all(text in other for other in texts.values())] if len(names) > 1 else []
    )
    repeated = {f"{name}: {text}" for name in names for text in common}
    return [*(line for line in changes if line not in repeated), *(f"all services: {text}" for text in common)]


def _is_named(key: str, lines: Sequence[str]) -> bool:
    return any(re.search(rf"(?<![\w-]){re.escape(key)}(?![\w-])", line) for line in lines)


def carried(application: ApplicationSource, cid: int, base: str, path_variables: set[str]) -> dict[str, str]:
    """Those that it uses and that are not secrets, with the test's CID, and paths relative to the test."""
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
