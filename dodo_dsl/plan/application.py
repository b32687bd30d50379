"""``plan_application``: the application as a test runs it, in containers and as processes."""

import os
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

from dodo_dsl.application import opendlv_flags
from dodo_dsl.application.construction import Construction, Setting
from dodo_dsl.application.interpolation import escaped
from dodo_dsl.application.merge import filled_node
from dodo_dsl.application.model import KEYS, SANDBOX, ApplicationSource, ComposeService, plain, references, text
from dodo_dsl.application.ros_topics import BRIDGE, Word, variables
from dodo_dsl.application.variables import variables_with_cid
from dodo_dsl.plan.added_services import TIME, TIME_MOUNT, time_variables
from dodo_dsl.plan.model import DISPLAY_SERVER, STARTED, Application, ApplicationService, Line

_LONG = 200
"""Characters of a line that says what differs."""


def plan_application(application: ApplicationSource, setting: Setting) -> Application:
    construction = Construction(application, setting)
    services = {name: _container(construction, name, made) for name, made in construction.services().items()}
    roots = tuple(_relative(root, setting.folder) for root in application.other_roots)
    access = replace(application.access, roots=roots)
    return Application(
        _relative(application.folder, setting.folder),
        tuple(
            _process(service, services[name], application, setting) for name, service in application.services.items()
        ),
        {"services": services, **construction.rest()},
        tuple(_changes(application, services)),
        setting.limits,
        secrets={name: _relative(file, setting.folder) for name, file in application.secrets.items()},
        access=access,
        copies=construction.copies,
    )


def _relative(path: Path, folder: Path) -> str:
    return Path(os.path.relpath(path, folder)).as_posix()


def _container(construction: Construction, name: str, made: dict[str, Any]) -> dict[str, Any]:
    service, setting = construction.application.services[name], construction.setting
    if service.declared and service.declared.lines:
        made["tty"] = True  # programs print each line at once to a terminal
        made["stdin_open"] = True  # the runner asks that terminal what was printed
    if construction.application.speaks_ros:
        made["environment"] = _in_graph(service, made.get("environment", {}), setting)
    if name == BRIDGE:
        image, *flags = setting.bridge
        made.update(image=image, command=[*made["command"], *map(escaped, flags)])
    if setting.time_seed is not None and setting.own_network:
        given = {variable: value or "" for variable, value in made.get("environment", {}).items()}
        number = list(construction.application.services).index(name)
        library = f"{TIME_MOUNT}/libdodo-time.so"
        made["environment"] = {
            **made.get("environment", {}),
            **time_variables(given, number, setting.time_seed, library),
        }
        made["pid"] = f"service:{SANDBOX}"
        mount = {"type": "volume", "source": TIME, "target": TIME_MOUNT, "read_only": True}
        made["volumes"] = [*(made.get("volumes") or []), mount]
    return made


def _in_graph(service: ComposeService, given: dict[str, Any], setting: Setting) -> dict[str, Any]:
    set_, maybe = variables(setting.cid, own_network=setting.own_network)
    own = {name: value for name, value in maybe.items() if name not in service.file_variables}
    return {**own, **given, **set_}


def _changes(application: ApplicationSource, made: dict[str, dict[str, Any]]) -> Iterator[str]:
    """What differs from the compose file, for the first lines of the test's own one."""
    yield from (f"{name}: left out, {why}" for name, why in application.dropped.items())
    for name, service in application.services.items():
        if name == BRIDGE:
            yield f"{name}: added, between the test's bus and the application's ROS graph"
            continue
        written = {key: each for key, each in plain(service.node).items() if key not in KEYS and each is not None}
        changed = sorted(key for key in written if key in made[name] and made[name][key] != written[key])
        gone = sorted(key for key in written if key not in made[name])
        parts = [f"{words} {', '.join(keys)}" for words, keys in (("changed:", changed), ("left out:", gone)) if keys]
        line = "".join(c if c.isprintable() else "?" for c in f"{name}: {'; '.join(parts)}")
        yield from [line if len(line) <= _LONG else f"{line[: _LONG - 3]}..."] if parts else []


def _process(
    service: ComposeService, container: dict[str, Any], application: ApplicationSource, setting: Setting
) -> ApplicationService:
    """The service as it starts without its container; its CID is filled in when it starts."""
    raw, own, cid = plain(service.node), service.declared, setting.cid
    known = {**application.known, **dict(setting.given)}

    def is_late(name: str) -> bool:
        return name in opendlv_flags.CID_VARIABLES or application.is_late(name)

    written = plain(filled_node(service.raw["command"], known, is_late)) if "command" in service.raw else None
    command = opendlv_flags.split(written) if isinstance(written, str) else tuple(text(word) for word in written or ())
    own_variables = variables_with_cid(service, known, is_late, dict(setting.given), cid)
    if application.speaks_ros:
        own_variables = _in_graph(service, own_variables, setting)
    if service.name == BRIDGE:
        command = (*command, *map(escaped, setting.bridge[1:]))
    process = raw.get("x-dodo-process")
    command = opendlv_flags.arguments(list(map(str, process or ())), command)
    words = (*(process or ()), *command)
    needed = [name for _, name in references(raw) if name in application.services]
    waits = {n: how for n, how in container.get("depends_on", {}).items() if n in application.services}
    return ApplicationService(
        name=service.name,
        process=(*(DISPLAY_SERVER if service.has_display else ()), *map(str, process)) if process else None,
        command=opendlv_flags.with_cid(command, cid),
        environment=own_variables,
        takes_cid=opendlv_flags.takes_cid((*words, *(v for v in own_variables.values() if v)), own_variables),
        takes_memory=opendlv_flags.takes_memory(words),
        env_files=tuple(file.path for file in service.env_files),
        raw_files=tuple(file.path for file in service.env_files if file.raw),
        inputs=_names(own.inputs) if own else (),
        outputs=_names(own.outputs) if own else (),
        after={**dict.fromkeys(needed, STARTED), **{n: how.get("condition", STARTED) for n, how in waits.items()}},
        optional=tuple(n for n, how in waits.items() if how.get("required") is False),
        lines=tuple(Line(n.match, n.message, n.sender, n.sample_time, n.take) for n in own.lines) if own else (),
    )


def _names(words: Iterable[Word]) -> tuple[str, ...]:
    return tuple(name for name, _ in words)
