"""The application's compose file: read with positions, and rewritten in a copy so that a test has it to itself."""

import os
import shlex
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dodo_dsl.diagnostics import Diagnostic, Span, did_you_mean, has_errors
from dodo_dsl.plan import argv
from dodo_dsl.plan.model import Application, ApplicationService
from dodo_dsl.source import Mapping, Node, Scalar, plain, read
from dodo_dsl.spec.schema import validate

SANDBOX = "sandbox"
KEYS = ("x-dodo", "x-dodo-process")
_DROPPED_TOP = ("version", "name", "networks")


@dataclass(frozen=True)
class ApplicationSource:
    """A compose file as it was written."""

    path: Path
    document: dict[str, Any]
    spans: dict[str, Span]


def read_application(path: Path) -> tuple[ApplicationSource | None, list[Diagnostic]]:
    """The compose file of an application and what keeps it from being one."""
    node, found = read(path)
    if node is None and not found:
        found = [Diagnostic(Span(str(path)), "application-file", "the file is empty, expected a compose file")]
    if node is not None:
        found = [*found, *validate(node, "application")]
    services = node.get("services") if isinstance(node, Mapping) else None
    if not isinstance(node, Mapping) or not isinstance(services, Mapping) or has_errors(found):
        return None, found
    spans = {name: entry.key for name, entry in services.entries.items()}
    problems = [p for name, entry in services.entries.items() for p in _problems(name, entry.value, entry.key)]
    if not has_errors(problems):
        problems.extend(_without_cid(services))
    found = [*found, *problems]
    if has_errors(found):
        return None, found
    return ApplicationSource(path.resolve(), plain(node), spans), found


def _without_cid(services: Mapping) -> list[Diagnostic]:
    """A warning when no service can be told which CID to use."""
    if any(_takes_cid(entry.value) for entry in services.entries.values()):
        return []
    first = next(iter(services.entries.values())).key
    message = "no service takes a CID (--cid=, CID or OD4SESSION_CID), so each test runs with the one built in"
    return [Diagnostic(first, "application-cid", message, "add --cid=111 to its command", "warning")]


def _problems(name: str, node: Node, key: Span) -> list[Diagnostic]:
    problems = []
    for word, entry in node.entries.items() if isinstance(node, Mapping) else ():
        if word.startswith("x-dodo") and word not in KEYS:
            hint = did_you_mean(word, KEYS)
            problems.append(Diagnostic(entry.key, "unknown-key", f"DoDo knows no key '{word}'", hint))
    command = node.get("command") if isinstance(node, Mapping) else None
    if isinstance(command, Scalar) and isinstance(command.value, str):
        try:
            shlex.split(command.text)
        except ValueError as error:
            problems.append(Diagnostic(command.span, "application-file", f"command of '{name}': {error}"))
    if name == SANDBOX or name.startswith("dodo-"):
        problems.append(Diagnostic(key, "application-file", f"the name '{name}' is kept for DoDo's own services"))
    return problems


def _takes_cid(node: Node) -> bool:
    service = plain(node)
    return isinstance(service, dict) and argv.takes_cid(_command(service), _environment(service))


def _command(service: dict[str, Any]) -> tuple[str, ...]:
    """The command as compose splits it."""
    command = service.get("command")
    if isinstance(command, str):
        return tuple(shlex.split(command))
    return tuple(str(word) for word in command or ())


def _environment(service: dict[str, Any]) -> dict[str, str | None]:
    """``environment`` as a map; None takes the value from DoDo's own environment."""
    raw = service.get("environment") or {}
    if isinstance(raw, list):
        pairs = (str(item).partition("=") for item in raw)
        return {name: value if sign else None for name, sign, value in pairs}
    return {str(k): None if v is None else _compose_text(v) for k, v in raw.items()}


def _compose_text(value: object) -> str:
    return ("true" if value else "false") if isinstance(value, bool) else str(value)


def plan_application(
    source: ApplicationSource, cid: int, isolation: str, folder: Path, after: tuple[str, ...]
) -> Application:
    """The application as a test runs it; ``folder`` is the compiled test's, ``after`` the services it waits for."""
    base = Path(os.path.relpath(source.path.parent, folder)).as_posix()
    changes: list[str] = []
    services: dict[str, Any] = {}
    planned = []
    for name, raw in source.document["services"].items():
        service = dict(raw or {})
        planned.append(_planned_service(name, service, cid))
        _Rewriter(name, service, base, changes).run(cid, isolation, after)
        services[name] = service
    rest = {k: v for k, v in source.document.items() if k not in ("services", *_DROPPED_TOP) and k[:2] != "x-"}
    return Application(base, tuple(planned), {"services": services, **rest}, tuple(changes))


def _planned_service(name: str, service: dict[str, Any], cid: int) -> ApplicationService:
    command, environment = _command(service), _environment(service)
    environment = {k: str(cid) if k in argv.CID_VARIABLES else v for k, v in environment.items()}
    process = service.get("x-dodo-process")
    words = (*(process or ()), *command)
    return ApplicationService(
        name=name,
        process=tuple(str(w) for w in process) if process else None,
        command=argv.with_cid(command, cid),
        environment=environment,
        takes_cid=argv.takes_cid(words, environment),
        takes_memory=argv.takes_memory(words),
    )


class _Rewriter:
    """Changes one service of the copy in place and writes down what it changed."""

    def __init__(self, name: str, service: dict[str, Any], base: str, changes: list[str]) -> None:
        self.name = name
        self.service = service
        self.base = base
        self.changes = changes

    def run(self, cid: int, isolation: str, after: tuple[str, ...]) -> None:
        self._command(cid)
        self._environment(cid)
        self._paths()
        for key in KEYS:
            self.service.pop(key, None)
        for key in ("container_name", "restart", "ports"):
            if self.service.pop(key, None) is not None:
                self._note(f"{key} removed")
        if isolation == "network":
            self._isolate()
        self._depend(after, isolation)

    def _note(self, change: str) -> None:
        self.changes.append(f"{self.name}: {change}")

    def _command(self, cid: int) -> None:
        command = self.service.get("command")
        if command is None:
            return
        words = [command] if isinstance(command, str) else [str(w) for w in command]
        changed = argv.with_cid(shlex.split(command), cid) if isinstance(command, str) else argv.with_cid(words, cid)
        before = tuple(shlex.split(command)) if isinstance(command, str) else tuple(words)
        if changed != before:
            self.service["command"] = list(changed)
            self._note(f"--cid={cid}")

    def _environment(self, cid: int) -> None:
        environment = _environment(self.service)
        told = [v for v in argv.CID_VARIABLES if v in environment]
        if told:
            self.service["environment"] = {**environment, **dict.fromkeys(told, str(cid))}
            self._note(f"{', '.join(told)}={cid}")

    def _isolate(self) -> None:
        service = self.service
        if service.pop("network_mode", None) is not None:
            self._note("network_mode removed, the test has a network of its own")
        if service.pop("networks", None) is not None:
            self._note("networks removed, the test has one of its own")
        if service.get("ipc") is not None:
            self._note("ipc is the test's own")
        service["ipc"] = f"service:{SANDBOX}"
        volumes = service.get("volumes")
        if isinstance(volumes, list):
            service["volumes"] = [self._own_tmp(volume) for volume in volumes]

    def _own_tmp(self, volume: Any) -> Any:
        if isinstance(volume, str) and (volume == "/tmp:/tmp" or volume.startswith("/tmp:/tmp:")):
            self._note("/tmp is the test's own")
            options = [o for o in volume.removeprefix("/tmp:/tmp").strip(":").split(",") if o in ("ro", "rw")]
            return "tmp:/tmp:" + ",".join([*options, "nocopy"])  # the image's own /tmp must not change the test's
        if isinstance(volume, dict) and (volume.get("source"), volume.get("target")) == ("/tmp", "/tmp"):
            self._note("/tmp is the test's own")
            return {"type": "volume", "source": "tmp", "target": "/tmp", "volume": {"nocopy": True}}
        return volume

    def _depend(self, after: tuple[str, ...], isolation: str) -> None:
        raw = self.service.get("depends_on") or {}
        own = {str(n): {"condition": "service_started"} for n in raw} if isinstance(raw, list) else dict(raw)
        waits = {name: {"condition": "service_healthy"} for name in after}
        if isolation == "network":
            waits = {SANDBOX: {"condition": "service_started"}, **waits}
        if waits or own:
            self.service["depends_on"] = {**own, **waits}

    def _paths(self) -> None:
        service = self.service
        build = service.get("build")
        if isinstance(build, str):
            service["build"] = self._rebased(build)
        elif isinstance(build, dict):
            service["build"] = {**build, "context": self._rebased(str(build.get("context", ".")))}
        env_file = service.get("env_file")
        if isinstance(env_file, str):
            service["env_file"] = self._rebased(env_file)
        elif isinstance(env_file, list):
            service["env_file"] = [self._env_file(item) for item in env_file]
        if isinstance(service.get("volumes"), list):
            service["volumes"] = [self._volume(volume) for volume in service["volumes"]]

    def _env_file(self, item: Any) -> Any:
        if isinstance(item, dict):
            return {**item, "path": self._rebased(str(item.get("path", "")))}
        return self._rebased(str(item))

    def _volume(self, volume: Any) -> Any:
        if isinstance(volume, str) and volume.startswith("."):
            source, sign, rest = volume.partition(":")
            return self._rebased(source) + sign + rest
        if isinstance(volume, dict) and str(volume.get("source", "")).startswith("."):
            return {**volume, "source": self._rebased(str(volume["source"]))}
        return volume

    def _rebased(self, path: str) -> str:
        """A path relative to the compiled test's folder; absolute paths, URLs and variables stay."""
        if path.startswith(("/", "~", "$")) or "://" in path or path.startswith("git@"):
            return path
        rebased = os.path.normpath(f"{self.base}/{path}")
        return rebased if rebased.startswith(".") else f"./{rebased}"
