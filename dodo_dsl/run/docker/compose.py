"""``docker compose`` for one compiled test: its images, network, volumes and containers.

DoDo's services are those of the compiled files, the application's those of the plan: with empty files and folders over
what their mounts would show of the tests.
"""

import asyncio
import json
import os
import re
import shutil
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from dodo_dsl import advice
from dodo_dsl.application import secret_variables
from dodo_dsl.application.host_paths import is_port
from dodo_dsl.application.interpolation import EnvironmentProblem, escaped, interpolate
from dodo_dsl.application.model import FILES
from dodo_dsl.emit.compose import CHANNEL
from dodo_dsl.plan.added_services import ANSWERS_VARIABLE, RUNNER_VARIABLE, without_time
from dodo_dsl.plan.model import LAYERS, Plan
from dodo_dsl.run.application_files import application_paths, variables_of
from dodo_dsl.run.docker.beside_processes import without_own
from dodo_dsl.run.docker.builds import HiddenContext, is_built, own_contexts, private_images
from dodo_dsl.run.docker.client import run
from dodo_dsl.run.docker.mounts import Bind, absent, binds, long_form, masks, over, whole
from dodo_dsl.run.docker.pulls import Pulls
from dodo_dsl.run.hidden_paths import hidden_paths
from dodo_dsl.run.process.commands import needed_paths
from dodo_dsl.run.protocol import BackendError, Say
from dodo_dsl.run.rigs.ports import known_ports
from dodo_dsl.run.sides import APPLICATION


def _write(file: Path, document: Mapping[str, Any]) -> None:
    text = json.dumps(document, ensure_ascii=False)  # as readers of YAML take no surrogates
    file.write_text(_NO_YAML.sub(lambda found: f"\\u{ord(found[0]):04x}", text), encoding="utf-8")


_NO_YAML = re.compile(r"[\x7f-\xa0\u2028\u2029\ud800-\udfff\ufeff\ufffe\uffff]")
"""What JSON has in texts, and YAML only as an escape."""
_EMPTY_FILE = ".hidden"
_BUILD_PROJECT = "dodo-build"
_OVERLAP = "overlaps"
_UNSEEN = re.compile("bind source path does not exist: (.*)")
_SHARED = (
    "work in a folder that it has, and set TMPDIR to one, at the same path; "
    "in Docker-in-Docker on GitLab, it has what is below /builds"
)


@dataclass
class Compose:
    """The test compiled into ``folder`` as a project; ``services`` are the application's after ``read``.

    If it ``is_whole``, DoDo's services are containers of it, else processes beside it. ``channel`` is the folder where
    services and runner meet, empty if that is a volume.
    """

    plan: Plan
    folder: Path
    report: Path
    project: str
    say: Say
    channel: str = ""
    is_whole: bool = True
    by_answers: bool = False
    services: dict[str, Any] = field(init=False)
    """Of the application, with the names of their images, empty for those that only a build makes."""
    _binds: dict[str, list[Bind]] = field(init=False)
    _outside: dict[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._application = self.plan.application.compose
        self._paths = application_paths(self.plan.application, self.folder)

    def read(self) -> None:
        """Fills ``services``; raises BackendError."""
        if shutil.which("docker") is None:
            raise BackendError(f"there is no program 'docker': {advice.DOCKER}")
        try:
            self._outside = variables_of(self.plan.application, self.folder)
            services = (self._application.get("services") or {}).items()
            self.services = {n: {**s, "image": interpolate(s.get("image") or "", self._outside)} for n, s in services}
        except EnvironmentProblem as error:
            raise BackendError(str(error)) from error
        copies = self.plan.application.copies.items()
        from_host = {"volumes": [{"type": "bind", "source": path, "target": f"/from/{name}"} for name, path in copies]}
        mounting = {**self.services, **({FILES: from_host} if copies else {})}
        self._binds = {name: list(binds(each, self.folder)) for name, each in mounting.items()}
        self._require_own()

    async def require_plugin(self) -> None:
        """Raises BackendError where the docker command cannot compose."""
        code, _ = await self.run("version")
        if code:
            raise BackendError(f"the docker command has no 'compose' of version 2: {advice.DOCKER}")

    def _require_own(self) -> None:
        """Raises BackendError if a path of the application leads elsewhere than when the test was compiled."""
        hidden = [place for place in self._hidden() if place.is_dir()]
        for key in ("configs", "secrets"):
            for name, about in (self._application.get(key) or {}).items():
                file = whole(about["file"], self.folder) if about.get("file") else ""
                if file and any(Path(os.path.realpath(file)).is_relative_to(place) for place in hidden):
                    what = f"the application may not have {key}.{name}.file: '{file}'"
                    raise BackendError(f"{what} lies where tests, their output or .git are kept")
        ports = tuple(known_ports(self.plan))
        for name, mounted in self._binds.items():
            devices = self.services.get(name, {}).get("devices") or ()
            paths = [
                whole(str(d["source"] if isinstance(d, dict) else d).partition(":")[0], self.folder) for d in devices
            ]
            if any(is_port(path, ports, within=True) for path in paths) or any(
                is_port(bind.source, ports) for bind in mounted
            ):
                raise BackendError(f"service '{name}' may not have the port of a rig, which only its service opens")
            for bind in mounted:
                if link := self._paths.link(bind.source):
                    what = f"'{bind.source}' of '{name}' is a symbolic link to '{link}'"
                    raise BackendError(f"{what}, outside the repository")

    def _hidden(self) -> list[Path]:
        return hidden_paths(self.plan.application, self.folder, self.report)

    def has_healthcheck(self, name: str) -> bool:
        """Whether the compose file has one for a service of the application."""
        check = self.services.get(name, {}).get("healthcheck")
        return bool(check) and not check.get("disable") and check.get("test") != ["NONE"]

    async def provide_images(self, pulls: Pulls) -> None:
        """Pulls and builds the services' images, once for all tests of a run; raises BackendError."""
        private = private_images(self.services, self._paths.folder, self._outside)
        foreign = {service["image"] for name, service in self.services.items() if name not in private}
        own = {service.image for service in self.plan.services}
        own |= {self.plan.sandbox_image} if self.plan.isolation == "network" or self.plan.application.copies else set()
        for note in await pulls.provide(self.plan, own if self.is_whole else (), foreign, self.say):
            self.say(note)
        for name, image in private.items():
            self.services[name]["image"] = image
        built = {name: service for name, service in self.services.items() if is_built(service)}
        if built:
            key = json.dumps(sorted(service["image"] for service in built.values()))
            await pulls.once(key, lambda: self._build(built))

    async def _build(self, services: Mapping[str, Any]) -> None:
        """Builds images in a project that all tests have in common, from folders without what is hidden."""
        self.say(f"building {', '.join(services)}")
        log = self.report / "logs" / "build.log"
        self.report.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix=".build-", dir=self.report) as name:
            copies = Path(name)
            try:
                builds = await asyncio.to_thread(own_contexts, services, self._hidden(), copies, self.folder)
            except (HiddenContext, OSError, shutil.Error) as error:
                raise BackendError(f"the application's images cannot be built: {error}") from error
            file = copies / "builds.compose.json"
            secrets = self._application.get("secrets") or {}
            _write(file, {"services": builds, "secrets": secrets})
            code, problem = await self.run("build", files=[str(file)], log=log, project=_BUILD_PROJECT)
        if code:
            where = f"{log.parent.name}/{log.name} of the test in the report"
            raise BackendError(f"the application's images cannot be built: {problem}; see {where}")

    async def create(self, subnets: Iterable[str]) -> None:
        """Creates network, volumes and containers, with the first subnet that is not in use; raises BackendError."""
        code, problem = 1, "no subnet is free"
        try:
            document = await asyncio.to_thread(self.document)
        except OSError as error:
            raise BackendError(f"the tests' files cannot be hidden from the application: {error}") from error
        with tempfile.TemporaryDirectory(prefix="dodo-compose-") as folder:
            own = Path(folder) / "application.compose.json"
            _write(own, document)
            files = [*(f"{layer}.compose.yml" for layer in LAYERS if layer != APPLICATION), str(own)]
            for subnet in subnets:
                code, problem = await self.run("create", "--no-build", "--pull", "never", files=files, subnet=subnet)
                if not code or _OVERLAP not in problem:
                    break
        if code:
            if unseen := _UNSEEN.search(problem):
                raise BackendError(f"the Docker engine does not see '{unseen[1]}' of this machine: {_SHARED}")
            raise BackendError(f"docker compose cannot create the test: {problem}")

    def document(self) -> dict[str, Any]:
        """A compose file with the application, and where DoDo's services meet on this host; raises OSError."""
        meeting = [Path(os.path.realpath(self.channel)).parent] if self.channel else []  # in /tmp, which cars mount
        hidden, empty = [*self._hidden(), *meeting], self.folder / _EMPTY_FILE
        if any(path.is_file() for path in hidden):
            empty.touch()
        meets = {"volumes": [{"type": "bind", "source": escaped(self.channel), "target": CHANNEL}]}
        services: dict[str, Any] = {s.name: meets for s in self.plan.services if self.channel and self.is_whole}
        for name, mounted in self._binds.items():
            lie_over = masks(mounted, hidden, empty) + absent(mounted, self._paths, always=name == FILES)
            service = {key: value for key, value in self.services.get(name, {}).items() if key != "build"}
            volumes = over([long_form(mount, self.folder) for mount in service.get("volumes") or ()], lie_over)
            services[name] = service | ({"volumes": volumes} if volumes else {})
            if name in self.services:
                services[name]["image"] = escaped(service["image"])
                if self.by_answers:
                    services[name]["environment"] = without_time(service.get("environment") or {})
        made = {**self._application, "services": services}
        if self.is_whole:
            return made
        needed = [*needed_paths(self.plan, self.folder, self.report), Path(self.channel)]
        return without_own(made, self.plan, needed)

    async def run(
        self, *words: str, files: Sequence[str] = (), subnet: str = "", log: Path | None = None, project: str = ""
    ) -> tuple[int, str]:
        """Exit code and the last line of standard error of a compose command."""
        own = {"COMPOSE_PROGRESS": "plain", "COMPOSE_PROJECT_NAME": project or self.project, RUNNER_VARIABLE: "dodo"}
        if self.by_answers:
            own[ANSWERS_VARIABLE] = "1"
        environment = {**secret_variables.of_client(os.environ), **self._outside, **own}
        for name in ("COMPOSE_FILE", "COMPOSE_PROFILES", "COMPOSE_ENV_FILES"):
            environment.pop(name, None)
        if subnet:
            environment["DODO_SUBNET"] = subnet
        named = [word for file in files for word in ("--file", file)]
        return await run(["compose", "--project-directory", ".", *named, *words], self.folder, environment, log)
