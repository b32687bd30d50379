"""``docker compose`` for one compiled test: its configuration, images, network, volumes and containers.

Empty files and folders lie over what an application's mounts would show of the tests: their files, results and history.
An error message about a generated file leads back to the line of the spec.
"""

import asyncio
import contextlib
import json
import os
import shutil
import tempfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from dodo_dsl import advice, atomic
from dodo_dsl.application import compose_paths, secret_variables
from dodo_dsl.application.host_paths import HostPaths, holds_port, is_port, is_rule_for_port
from dodo_dsl.application.interpolation import EnvironmentProblem
from dodo_dsl.application.model import FILES, image_variable
from dodo_dsl.opendlv.authentication import KEY_VARIABLE
from dodo_dsl.plan.added_services import RUNNER_VARIABLE
from dodo_dsl.plan.model import LAYERS, Plan
from dodo_dsl.run.application_files import application_paths, secrets_of
from dodo_dsl.run.docker.builds import HiddenContext, is_built, own_contexts, private_images
from dodo_dsl.run.docker.pulls import PullError, Pulls, Say, image_hints
from dodo_dsl.run.hidden_paths import hidden_paths
from dodo_dsl.run.protocol import BackendError
from dodo_dsl.run.rigs.permission import known_ports


def masks(
    service: Mapping[str, Any], volumes: Mapping[str, Any], hidden: Sequence[Path], empty: Path
) -> list[dict[str, Any]]:
    """Mounts that hide files and folders, as ``docker compose config`` shows the service and the file's ``volumes``.

    The file that is ``empty`` takes the place of files.
    """
    targets = {Path(target): is_file for target, is_file in _targets(service, volumes, hidden)}
    outer = {target: is_file for target, is_file in targets.items() if targets.keys().isdisjoint(target.parents)}
    kinds = {True: {"type": "bind", "source": str(empty)}, False: {"type": "tmpfs"}}
    return [{**kinds[is_file], "target": str(target), "read_only": True} for target, is_file in outer.items()]


def absent(service: Mapping[str, Any], paths: HostPaths, always: bool = False) -> list[dict[str, Any]]:
    """Empty folders in the place of what is mounted and not there: the engine would make it, as root.

    What dodo.yml lets an application write to is the host's own, and made as always; without ``always``, the engine
    refuses what it must not make.
    """
    binds = [volume for volume in service.get("volumes") or () if volume.get("type") == "bind"]
    gone = [v for v in binds if not os.path.lexists(v["source"]) and not paths.is_writable(v["source"])]
    made = [v for v in gone if always or v.get("bind", {}).get("create_host_path")]
    return [{"type": "tmpfs", "target": volume["target"], "read_only": True} for volume in made]


def _targets(
    service: Mapping[str, Any], volumes: Mapping[str, Any], hidden: Sequence[Path]
) -> Iterator[tuple[str, bool]]:
    """Places in the container, and whether a file is there."""
    for volume in service.get("volumes") or ():
        source = _source(volume, volumes)
        if source is None:
            continue
        for path in hidden:
            if source == path or source.is_relative_to(path):
                yield volume["target"], path.is_file()
            elif path.is_relative_to(source):
                yield str(Path(volume["target"], path.relative_to(source))), path.is_file()


def _source(volume: Mapping[str, Any], volumes: Mapping[str, Any]) -> Path | None:
    """The folder of the host that a mount shows, if it does."""
    source = volume.get("source")
    if volume.get("type") == "volume":
        options = (volumes.get(str(source)) or {}).get("driver_opts") or {}
        source = options.get("device") if "bind" in str(options.get("o", "")) else None
    elif volume.get("type") != "bind":
        return None
    return Path(os.path.realpath(source)) if source else None


def traced(plan: Plan, text: str) -> str:
    """The message, followed by the place in the spec of the service that it names."""
    place = plan.place_named_in(text)
    return f"{text} ({place.file}:{place.line}:{place.column})" if place else text


_EMPTY_FILE = ".hidden"
_BUILD_PROJECT = "dodo-build"
_OVERLAP = "overlaps"
_NO_COMPOSE = "docker --help"
"""Where the docker command refers to, and compose itself never does."""
_YIELDING = ("nice", "-n", "10")  # set-up must not slow down tests that already run


class Compose:
    """The test compiled into ``folder`` as a project; ``services`` are those of its files after ``read``."""

    def __init__(self, plan: Plan, folder: Path, report: Path, project: str, say: Say) -> None:
        self.plan = plan
        self.folder = folder
        self.report = report
        self.project = project
        self.services: dict[str, Any] = {}
        self._volumes: dict[str, Any] = {}
        self._secrets: dict[str, Any] = {}
        self._images: dict[str, str] = {}
        self._say = say
        self._paths = application_paths(plan.application, folder)
        self._outside: dict[str, str] = {}

    async def read(self) -> None:
        """Fills ``services``; raises BackendError."""
        try:
            outside = secret_variables.allowed(os.environ, self.plan.application.access.passed)
            self._outside = {**secrets_of(self.plan.application, self.folder, outside), **outside}
        except EnvironmentProblem as error:
            raise BackendError(str(error)) from error
        if shutil.which("docker") is None:
            raise BackendError(f"there is no program 'docker': {advice.docker()}")
        code, out, problem = await self._run("config", "--format", "json")
        if code and _NO_COMPOSE in problem and (await self._run("version"))[0]:
            raise BackendError(f"the docker command has no 'compose' of version 2: {advice.docker_plugin('compose')}")
        if code:
            raise BackendError(f"docker compose rejects the compiled test: {traced(self.plan, problem)}")
        config = compose_paths.unescaped(json.loads(out))
        self._require_own(config)
        self._secrets = config.get("secrets") or {}
        self._take(config)

    def _take(self, config: dict[str, Any]) -> None:
        """Keeps what the engine is asked for of the test as ``docker compose config`` shows it."""
        self.services, self._volumes = config["services"], config.get("volumes") or {}

    def _require_own(self, config: dict[str, Any]) -> None:
        """Raises BackendError if a path of the application leads elsewhere than when the test was compiled."""
        hidden = [place for place in hidden_paths(self.plan.application, self.folder, self.report) if place.is_dir()]
        for key in ("configs", "secrets"):
            for name, about in (config.get(key) or {}).items():
                file = about.get("file") if isinstance(about, dict) else None
                if file and any(Path(os.path.realpath(file)).is_relative_to(place) for place in hidden):
                    raise BackendError(
                        f"the application may not have {key}.{name}.file: '{file}' lies where tests, their output or "
                        ".git are kept"
                    )
        ports = tuple(known_ports(self.plan))
        for service in self.plan.application.services:
            made = config["services"].get(service.name, {})
            devices = [str(each.get("source")) for each in made.get("devices") or ()]
            mounted = [str(v.get("source")) for v in made.get("volumes") or () if v.get("type") == "bind"]
            rules = made.get("device_cgroup_rules") or ()
            if (
                any(holds_port(path, ports) for path in devices)
                or any(is_port(path, ports) for path in mounted)
                or any(is_rule_for_port(r, ports) for r in rules)
            ):
                raise BackendError(
                    f"service '{service.name}' may not have the port of a rig, which only its service opens"
                )
            for volume in made.get("volumes") or ():
                if volume.get("type") == "bind" and (link := self._paths.link(volume["source"])):
                    what = f"'{volume['source']}' of '{service.name}' is a symbolic link to '{link}'"
                    raise BackendError(f"{what}, outside the repository")

    def has_healthcheck(self, name: str) -> bool:
        check = self.services.get(name, {}).get("healthcheck")
        return bool(check) and not check.get("disable") and check.get("test") != ["NONE"]

    async def provide_images(self, pulls: Pulls) -> None:
        """Pulls and builds the services' images, once for all tests of a run; raises BackendError."""
        application = {s.name for s in self.plan.application.services}
        built = [name for name, s in self.services.items() if is_built(s)]
        self._images = private_images(self.services, application)
        own = {s["image"] for name, s in self.services.items() if name not in application}
        foreign = {
            s["image"]
            for name, s in self.services.items()
            if name in application and name not in built and image_variable(name) not in self._images
        }
        try:
            notes = await pulls.provide(own, foreign, self._say, image_hints(self.plan))
        except PullError as error:
            raise BackendError(f"{error}{self._other_way(error.image)}") from error
        for note in notes:
            self._say(note)
        named = [name for name in built if "image" in self.services[name]]
        if named:
            key = json.dumps([self._images[image_variable(name)] for name in named])
            await pulls.once(key, lambda: self._build(named, _BUILD_PROJECT))
        if len(named) < len(built):
            await self._build([name for name in built if name not in named], self.project)

    def _other_way(self, image: str) -> str:
        """How a service of the application starts without its image; empty if it has a process, and for others."""
        with_image = {name for name, service in self.services.items() if service.get("image") == image}
        found = [s.name for s in self.plan.application.services if s.name in with_image and not s.process]
        return f"; with 'x-dodo-process: [python, main.py]' '{found[0]}' starts as a process" if found else ""

    async def _build(self, names: list[str], project: str) -> str:
        """Builds images; compose labels them with the project, so named images are built in one common project."""
        self._say(f"building {', '.join(names)}")
        log = self.report / "logs" / "build.log"
        self.report.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix=".build-", dir=self.report) as folder:
            try:
                file = await asyncio.to_thread(self._builds, Path(folder))
            except (HiddenContext, OSError, shutil.Error) as error:
                raise BackendError(f"the application's images cannot be built: {error}") from error
            code, _, problem = await self._run("build", *names, log=log, project=project, files=str(file))
        if code:
            where = f"{log.parent.name}/{log.name} of the test in the report"
            raise BackendError(f"the application's images cannot be built: {problem}; see {where}")
        return ""

    def _builds(self, folder: Path) -> Path:
        """Writes a compose file with the application's builds alone, which get nothing that it never sees."""
        hidden = hidden_paths(self.plan.application, self.folder, self.report)
        services = own_contexts({n: s for n, s in self.services.items() if is_built(s)}, hidden, folder)
        for name, service in services.items():
            if image := self._images.get(image_variable(name)):
                service["image"] = image
        file = folder / "builds.compose.json"
        content = compose_paths.escaped_values({"services": services, "secrets": self._secrets})
        file.write_text(json.dumps(content), encoding="utf-8")
        return file

    async def create(self, subnets: Iterable[str], key: bytes) -> None:
        """Creates network, volumes and containers, with the first subnet that is not in use; raises BackendError.

        DoDo's services get the ``key`` in a file, as any variable could be named in the application's file;
        so do the application's services what hides the tests from them.
        """
        code, problem = 1, "no subnet is free"
        try:
            masked = await asyncio.to_thread(self._masks)
        except OSError as error:
            raise BackendError(f"the tests' files cannot be hidden from the application: {error}") from error
        with tempfile.TemporaryDirectory(prefix="dodo-key-") as folder:
            keys = Path(folder) / "keys.compose.json"
            given: dict[str, Any] = {
                service.name: {"environment": {KEY_VARIABLE: key.hex()}}
                for service in self.plan.services
                if service.name in self.services
            }
            given.update(compose_paths.escaped_values(masked))
            keys.write_text(json.dumps({"services": given}), encoding="utf-8")
            files = os.pathsep.join([*self._files(Path(folder)), str(keys)])
            for subnet in subnets:
                code, _, problem = await self._run(
                    "create", "--no-build", "--pull", "never", subnet=subnet, files=files
                )
                if not code or _OVERLAP not in problem:
                    break
        if code:
            raise BackendError(f"docker compose cannot create the test: {traced(self.plan, problem)}")

    def _files(self, _folder: Path) -> list[str]:
        """The project's compose files; others than the compiled ones may be written into a private folder."""
        return [f"{layer}.compose.yml" for layer in LAYERS]

    def _masks(self) -> dict[str, Any]:
        """What hides the tests from the application's services, and stands for what is not there; raises OSError."""
        hidden = hidden_paths(self.plan.application, self.folder, self.report)
        empty = self.folder / _EMPTY_FILE
        if any(path.is_file() for path in hidden):
            empty.touch()
        every = (*(service.name for service in self.plan.application.services), FILES)
        names = [name for name in every if name in self.services]
        found = {
            name: [
                *masks(self.services[name], self._volumes, hidden, empty),
                *absent(self.services[name], self._paths, always=name == FILES),
            ]
            for name in names
        }
        return {name: {"volumes": mounts} for name, mounts in found.items() if mounts}

    async def _run(
        self, *words: str, subnet: str = "", log: Path | None = None, project: str = "", files: str = ""
    ) -> tuple[int, str, str]:
        """Exit code, standard output and the last line of standard error of a compose command."""
        own = {"COMPOSE_PROGRESS": "plain", "COMPOSE_PROJECT_NAME": project or self.project, RUNNER_VARIABLE: "dodo"}
        environment = {**secret_variables.of_client(os.environ), **self._outside, **self._images, **own}
        for name in ("COMPOSE_FILE", "COMPOSE_PROFILES", "COMPOSE_PATH_SEPARATOR", "COMPOSE_ENV_FILES"):
            environment.pop(name, None)  # the test's own .env sets them
        if files:
            environment["COMPOSE_FILE"] = files
        if subnet:
            environment["DODO_SUBNET"] = subnet
        process = await asyncio.create_subprocess_exec(
            *_YIELDING, "docker", "compose", *words, cwd=self.folder, env=environment, stdin=asyncio.subprocess.DEVNULL,
            stdout=asyncio.subprocess.PIPE, stderr=asyncio.subprocess.PIPE,
        )  # fmt: skip
        try:
            out, err = await process.communicate()
        except asyncio.CancelledError:
            with contextlib.suppress(ProcessLookupError):
                process.kill()
            await process.wait()
            raise
        if log is not None:
            atomic.write_bytes(log, out + err)
        errors = [line for line in err.decode("utf-8", "replace").splitlines() if line.strip()]
        return process.returncode or 0, out.decode("utf-8", "replace"), errors[-1].strip() if errors else ""
