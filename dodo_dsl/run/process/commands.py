"""What starts a test's services as local processes: words, variables, folder, with the lane's CID and memories."""

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from dodo_dsl import package_data
from dodo_dsl.application.opendlv_flags import CID_VARIABLES, memory_name, with_cid, with_cid_text, with_memory_prefix
from dodo_dsl.plan.model import ApplicationService, Flag, Plan, Service
from dodo_dsl.run.process.environment import base_environment, dotenv, interpolate

OWN_VARIABLES = ("PYTHONPATH", "DODO_LANE")
"""What the sandbox has otherwise than the runner, so it is always said."""


@dataclass(frozen=True)
class Lane:
    """What keeps tests apart: a CID, a name, a prefix of shared memory, and the descriptors of the leases."""

    cid: int
    name: str = ""
    memory_prefix: str = ""
    descriptors: tuple[int, ...] = ()


@dataclass(frozen=True)
class Command:
    """A process to start."""

    name: str
    layer: str
    argv: tuple[str, ...]
    environment: Mapping[str, str]
    folder: Path
    judge: bool = False
    module: bool = False
    """Whether it is one of DoDo's own Python modules, for which a fork of what has loaded their libraries will do."""


@dataclass(frozen=True)
class Commands:
    """Makes them for one test; ``folder`` is the compiled test's, ``report`` takes its recordings."""

    plan: Plan
    folder: Path
    report: Path
    lane: Lane

    def of(self, service: Service | ApplicationService) -> Command:
        """The service's command; raises MissingVariable."""
        return self._own(service) if isinstance(service, Service) else self._application(service)

    def _own(self, service: Service) -> Command:
        environment = {
            **base_environment(),
            "PYTHONPATH": package_path(),
            "DODO_SERVICE": service.name,
            "DODO_READY_FILE": ready_file(self.lane.name, service.name),
            "DODO_LANE": self.lane.name,
            "DODO_ODVD": os.pathsep.join(str(self.folder / "files" / path) for path in self.plan.messages),
            **self.plan.variables,
        }
        words = (*service.process, *(self._flag(flag) for flag in service.flags))
        module = _is_module(service.process)
        return Command(service.name, service.layer, words, environment, self.folder, service.judge, module)

    def _flag(self, flag: Flag) -> str:
        values: dict[str, Callable[[], str]] = {
            "path": lambda: str(self.folder / "files" / flag.value),
            "report": lambda: str(self.report / flag.value),
            "memory": lambda: memory_name(flag.value, self.lane.memory_prefix),
            "memories": lambda: ",".join(memory_name(m, self.lane.memory_prefix) for m in flag.value.split(",")),
        }
        value = values.get(flag.kind, lambda: flag.value)()
        return f"--{flag.name}={self.lane.cid if flag.name == 'cid' else value}"

    def _application(self, service: ApplicationService) -> Command:
        folder = (self.folder / self.plan.application.folder).resolve()
        inherited = base_environment()
        told = {name: str(self.lane.cid) for name in CID_VARIABLES}
        variables = {**dotenv(folder / ".env", inherited), **inherited}
        variables.update({name: cid for name, cid in told.items() if name in self.plan.application.variables})
        own: dict[str, str] = {}
        for path in service.env_files:
            own.update(dotenv(folder / Path(interpolate(path, variables)).expanduser(), variables))
        for name, value in service.environment.items():
            own[name] = variables.get(name, "") if value is None else interpolate(value, variables)
        own = {name: told.get(name, with_cid_text(value, self.lane.cid)) for name, value in own.items()}
        told_words = ((word, interpolate(word, variables)) for word in service.command)
        words = tuple(value for word, value in told_words if value or not word.startswith("$"))
        argv = with_memory_prefix(with_cid((*(service.process or ()), *words), self.lane.cid), self.lane.memory_prefix)
        environment = {**inherited, **own, "DODO_LANE": self.lane.name}
        return Command(service.name, "application", argv, environment, folder)


def _is_module(process: Sequence[str]) -> bool:
    """Whether a program is ``python -m`` with one of DoDo's own services."""
    package, _, name = process[2].partition(".") if len(process) == 3 and process[:2] == ("python", "-m") else ("",) * 3
    return (
        package == "services"
        and name.isidentifier()
        and (package_data.root() / package / name / "__main__.py").is_file()
    )


def ready_file(lane: str, service: str) -> str:
    """Where a service leaves its ready file; in a lane of the host, what begins with the lane's name is removed."""
    return f"/tmp/{lane}ready-{service}" if lane else f"/tmp/dodo-ready-{service}"


def changes(base: Mapping[str, str], wanted: Mapping[str, str]) -> dict[str, str | None]:
    """What to set, and with None to remove, to make ``wanted`` of ``base``: the sandbox has the base already."""
    different: dict[str, str | None] = {name: value for name, value in wanted.items() if base.get(name) != value}
    return {**different, **{name: wanted.get(name) for name in OWN_VARIABLES}}


def package_path() -> str:
    """``PYTHONPATH`` for services and sandbox: where ``services`` lies, and where ``dodo_dsl`` does."""
    places = [str(package_data.root()), str(Path(__file__).resolve().parents[3]), os.environ.get("PYTHONPATH", "")]
    return os.pathsep.join(dict.fromkeys(p for p in places if p))
