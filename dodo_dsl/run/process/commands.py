"""Commands that start a test's services as local processes: words, variables and folder, for the test's slot."""

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from dodo_dsl import package_data
from dodo_dsl.application.interpolation import EnvironmentProblem, dotenv_file, interpolate
from dodo_dsl.application.model import OFFSCREEN
from dodo_dsl.application.opendlv_flags import CID_VARIABLES, memory_name, with_cid, with_cid_text, with_memory_prefix
from dodo_dsl.application.ros_topics import BRIDGE
from dodo_dsl.application.ros_topics import variables as ros_variables
from dodo_dsl.emit.output_folder import FILES
from dodo_dsl.opendlv.address import CHANNEL_VARIABLE
from dodo_dsl.plan.added_services import ANSWERS_VARIABLE, TIME, TIME_FOLDER
from dodo_dsl.plan.model import DISPLAY_SERVER, ApplicationService, Flag, Plan, PlannedService
from dodo_dsl.run.application_files import application_paths, variables_of
from dodo_dsl.run.application_time import ApplicationTime, folder_of
from dodo_dsl.run.hidden_paths import hidden_paths, own_data
from dodo_dsl.run.process.confinement import Command, Confinement, readable
from dodo_dsl.run.process.environment import application_environment, base_environment
from dodo_dsl.run.process.slot import SLOT_VARIABLE, Slot, named_paths, package_path
from dodo_dsl.run.rigs.ports import masked


@dataclass(frozen=True)
class Commands:
    """Makes the commands of one test; ``folder`` is the compiled test's, ``report`` takes its recordings."""

    plan: Plan
    folder: Path
    report: Path
    slot: Slot
    is_on_host: bool = False
    is_apart: bool = True
    """Whether the application has its own processes, where it is on the host."""
    time: ApplicationTime | None = None
    """What gives the application the test's time, where it runs here."""
    by_answers: bool = False
    """Whether the clock waits for answers, as the application keeps the machine's time."""

    def of(self, service: PlannedService | ApplicationService) -> Command:
        """The service's command; raises EnvironmentProblem."""
        return self._own(service) if isinstance(service, PlannedService) else self._application(service)

    def _own(self, service: PlannedService) -> Command:
        is_module = bool(own_module(service.process))
        environment = {
            **base_environment(self.plan.application.access.passed),
            "PYTHONPATH": package_path(() if is_module else import_paths(self.plan, self.folder)),
            "DODO_SERVICE": service.name,
            SLOT_VARIABLE: self.slot.name,
            CHANNEL_VARIABLE: self.slot.channel,
            "DODO_ODVD": os.pathsep.join(str(self.folder / FILES / path) for path in self.plan.messages),
            **self.plan.variables,
            **({ANSWERS_VARIABLE: "1"} if self.by_answers else {}),
        }
        words = (*service.process, *(self._flag(flag) for flag in service.flags))
        hidden = self._masked(service)
        return Command(service.name, service.layer, words, environment, str(self.folder), is_module, hidden)

    def _masked(self, service: PlannedService | None) -> tuple[str, ...]:
        return tuple(masked(self.plan, service)) if self.is_on_host and self.is_apart else ()

    def _flag(self, flag: Flag) -> str:
        value = {"cid": str(self.slot.cid), TIME_FOLDER: self.time_folder}.get(flag.name, flag.value)
        if flag.kind in ("path", "report"):
            value = str((self.report if flag.kind == "report" else self.folder / FILES) / value)
        elif flag.kind in ("memory", "memories"):
            value = ",".join(memory_name(name, self.slot.memory_prefix) for name in value.split(","))
        return f"--{flag.name}={value}"

    @property
    def time_folder(self) -> str:
        return folder_of(self.slot.name)

    def of_time(self) -> Command:
        assert self.time is not None
        words = self.time.words(self.plan, self.time_folder, on_host=self.is_on_host)
        environment = {**base_environment(self.plan.application.access.passed), SLOT_VARIABLE: self.slot.name}
        return Command(TIME, "environment", words, environment, str(self.folder))

    def _application(self, service: ApplicationService) -> Command:
        folder = (self.folder / self.plan.application.folder).resolve()
        inherited = application_environment(self.plan.application.access.passed)
        cids = {name: str(self.slot.cid) for name in CID_VARIABLES}
        variables = {**variables_of(self.plan.application, self.folder), **cids}
        given = {
            name: variables[name] if value is None else interpolate(value, variables)
            for name, value in service.environment.items()
            if value is not None or name in variables
        }
        own: dict[str, str] = {}
        paths = application_paths(self.plan.application, self.folder)
        for path in service.env_files:
            if problem := paths.file_problem(path):
                raise EnvironmentProblem(f"env_file of '{service.name}': {problem}")
            raw = path in service.raw_files
            own.update(dotenv_file(Path(paths.whole(path)), {**given, **variables}, own, raw=raw))
        own.update(given)
        own = {name: cids.get(name, with_cid_text(value, self.slot.cid)) for name, value in own.items()}
        if self.plan.isolation == "host" and any(each.name == BRIDGE for each in self.plan.application.services):
            own |= ros_variables(self.slot.cid, own_network=False)[0]  # the slot's CID may be another than the plan's
        pairs = ((word, interpolate(word, variables)) for word in service.command)
        words = tuple(value for word, value in pairs if value or not word.startswith("$"))
        argv = with_memory_prefix(with_cid((*(service.process or ()), *words), self.slot.cid), self.slot.memory_prefix)
        own.update({"PYTHONPATH": package_path()} if service.name == BRIDGE else {})
        environment = {**_without_windows(argv, {**inherited, **own}), SLOT_VARIABLE: self.slot.name}
        if self.time is not None:
            environment = self.time.variables(environment, self.plan, service.name, self.time_folder)
        confined = self._confined(service.name, folder) if self.is_confined else None
        hidden = self._masked(None)
        return Command(service.name, "application", argv, environment, str(folder), masked=hidden, confined=confined)

    @property
    def is_confined(self) -> bool:
        return not self.is_on_host or self.is_apart

    def _confined(self, name: str, folder: Path) -> Confinement:
        """How a process of the application is kept apart."""
        limits = self.plan.application.limits
        more = [*([self.time.library] if self.time else []), *([package_data.services()] if name == BRIDGE else [])]
        processes = limits.processes * len(self.plan.application.services)  # of one user, as they count
        return Confinement(
            str(folder),
            readable(folder, limits, *more),
            () if self.is_on_host else self._hidden(),
            replace(limits, processes=processes),
            channels=str(Path(self.slot.channel).parent) if self.is_on_host else "",
            time=self.time_folder if self.time else "",
        )

    def _hidden(self) -> tuple[str, ...]:
        """What an application never sees, and what lies around its folder: its repository, the test's folders."""
        known = hidden_paths(self.plan.application, self.folder, self.report)
        roots = application_paths(self.plan.application, self.folder).roots
        places = (path.resolve() for path in (self.folder, self.report, Path(self.slot.channel).parent))
        return tuple(dict.fromkeys(map(str, (*known, *own_data(), *roots, *places))))


def _without_windows(argv: Sequence[str], environment: dict[str, str]) -> dict[str, str]:
    """The environment of a program that has no display: one that draws with Qt draws nowhere instead of ending."""
    has_display = bool(environment.get("DISPLAY")) or argv[:1] == DISPLAY_SERVER[:1]
    return environment if has_display else {**OFFSCREEN, **environment}


def import_paths(plan: Plan, folder: Path) -> list[Path]:
    """The folders of the packages of the deployment's own services; ``folder`` is the compiled test's."""
    return [(folder / path).resolve() for path in plan.import_paths]


def needed_paths(plan: Plan, folder: Path, report: Path) -> list[Path]:
    """What a test's processes are given, and may find in the machine's ``/tmp``: folders, programs, parameters.

    Nothing that the application says but its program: it would learn by guesses what is there.
    """
    paths = application_paths(plan.application, folder)
    words = [word for service in plan.services for word in (*service.process, *(flag.value for flag in service.flags))]
    words += [word for service in plan.application.services for word in (service.process or ())[:1]]
    words += [*plan.variables.values()]
    reads = [paths.folder / Path(path).expanduser() for path in plan.application.limits.reads]
    return [folder, report, *import_paths(plan, folder), paths.folder, *paths.roots, *reads, *named_paths(words)]


def own_module(process: Sequence[str]) -> str:
    """The module of ``python -m`` with one of DoDo's own services; empty for any other program."""
    if len(process) != 3 or tuple(process[:2]) != ("python", "-m"):
        return ""
    package, _, name = process[2].partition(".")
    is_ours = package == "services" and name.isidentifier()
    return process[2] if is_ours and (package_data.root() / package / name / "__main__.py").is_file() else ""
