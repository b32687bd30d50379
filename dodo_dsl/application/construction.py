"""The application's part of a test, constructed from its compose files: services, volumes, secrets and configs.

Only what a test carries gets into it, so that nothing has to be looked for in it afterwards. Problems are collected
meanwhile, each at its place in the file: to check an application is to construct it.
"""

import os
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from dodo_dsl.application import compose_paths, secret_variables
from dodo_dsl.application.container import TOP_LEFT_OUT, Container
from dodo_dsl.application.interpolation import interpolate
from dodo_dsl.application.model import ApplicationSource, ComposeService, is_true
from dodo_dsl.application.mounts import COPY, mounts, nested, own_name, volume
from dodo_dsl.application.part import Part
from dodo_dsl.diagnostics import Diagnostic, Span
from dodo_dsl.source import Mapping, Node, Scalar, entries
from dodo_dsl.spec.sandbox_limits import SandboxLimits

_NAMED = ("volumes", "secrets", "configs")
_OF_SERVICES = {"image", "build", "command", "x-dodo", "x-dodo-process"}


@dataclass(frozen=True)
class Setting:
    """What a test's copy of the application depends on; ``folder`` is the compiled test's.

    ``waits`` are the services of DoDo after which the application starts. Devices stay only with ``hil``, privileges
    only with ``privileged_allowed`` as well. ``limits`` is what a service gets that sets none, and ``given`` are
    variables that the test sets. With a ``time_seed``, the application's own time is the test's.
    """

    cid: int
    isolation: str
    folder: Path
    waits: tuple[str, ...] = ()
    hil: bool = False
    privileged_allowed: bool = False
    limits: SandboxLimits = field(default_factory=SandboxLimits)
    given: tuple[tuple[str, str], ...] = ()
    time_seed: int | None = None

    @property
    def own_network(self) -> bool:
        return self.isolation == "network"

    @property
    def keeps_privileges(self) -> bool:
        return self.hil and self.privileged_allowed


class Construction:
    """One test's application while it is made; ``copies`` are volumes, each with the folder that it has at the start.

    ``shown`` are the paths of the host that it asks for, each with its place and the service that writes to it, if any.
    """

    def __init__(self, application: ApplicationSource, setting: Setting) -> None:
        self.application, self.setting = application, setting
        self.paths, self.ports = application.paths, application.access.ports
        self.base = Path(os.path.relpath(application.folder, setting.folder)).as_posix()
        self.problems: list[Diagnostic] = []
        self.shown: list[tuple[str, Span, str]] = []
        self.copies: dict[str, str] = {}
        self._copied: dict[str, str] = {}
        self.volumes = {name: volume(self, name, node, span) for name, node, span in self._named("volumes")}
        found = len(self.problems)
        for service in application.services.values():  # those that only read a folder see the copy of others, too
            if node := service.node.get("volumes"):
                mounts(Container(self, service), node)
        self.shown.clear()
        del self.problems[found:]

    def _named(self, key: str) -> Iterator[tuple[str, Node, Span]]:
        top = self.application.top.get(key)
        for name, entry in (entries(top.value) if top else {}).items():
            yield name, entry.value, entry.key

    def rebased(self, path: str) -> str:
        """A path of the application as seen from the compiled test's folder."""
        if path.startswith(("/", "~")):
            return path
        joined = os.path.normpath(f"{self.base}/{path}")
        return joined if joined.startswith(".") else f"./{joined}"

    def show(self, source: str, span: Span, writer: str = "") -> None:
        if source:
            self.shown.append((source, span, writer))

    def copied(self, source: str) -> str:
        """The volume with the copy of a folder to which a service writes; empty for all others."""
        return self._copied.get(self.paths.names(source)[-1], "")

    def copy_of(self, source: str, name: str = "") -> str:
        """The volume with the test's copy of a folder of the repository; empty for files and other paths.

        All services that mount the folder share its copy, so that none can lead the mount of another one elsewhere.
        """
        paths = self.paths
        if not paths.is_own(source) or paths.is_writable(source):
            return ""
        place = paths.names(source)[-1]
        if Path(place).is_file():
            return ""
        if name or place not in self._copied:
            own = name or f"{COPY}{sum(each.startswith(COPY) for each in self.copies)}"
            self._copied.setdefault(place, own)
            self.copies[own] = compose_paths.escaped(self.rebased(source))
            return own
        return self._copied[place]

    def service(self, service: ComposeService) -> dict[str, Any]:
        """A service of the compose file as a container of the test."""
        return Container(self, service).made()

    def rest(self) -> dict[str, Any]:
        """The top-level keys beside ``services``, for services that are made already."""
        made = {key: self._files(key) for key in ("secrets", "configs")}
        volumes = {own_name(name): about.made for name, about in self.volumes.items()}
        volumes |= {name: {} for name in self.copies if name not in volumes}
        return {key: value for key, value in {"volumes": volumes, **made}.items() if value}

    def _files(self, key: str) -> dict[str, Any]:
        return {name: self._file(key, name, node, span) for name, node, span in self._named(key)}

    def _file(self, key: str, name: str, node: Node, span: Span) -> dict[str, Any]:
        """A secret or config: of a file of the repository, of a variable that is passed, or a text."""
        what = f"the {key[:-1]} '{name}'"
        of = Part(self, what, span)
        fields = of.fields(
            node, what, "file environment content", "labels name",
            refused=dict.fromkeys(("driver", "driver_opts", "template_driver"), "a program would provide it")
            | {"external": f"the engine's {key} are not the application's"},
        )  # fmt: skip
        if "file" in fields:
            file = of.path(of.literal(fields["file"]), fields["file"].span)
            return {"file": file} if file else {}
        if "content" in fields and isinstance(text := fields["content"], Scalar):
            return {"content": text.text}
        variable = of.literal(fields["environment"]) if "environment" in fields else None
        if variable and self.application.is_late(variable):
            return {"environment": variable}
        if variable and variable in self.application.known and key == "configs":
            return {"content": compose_paths.escaped(self.application.known[variable])}
        if variable and secret_variables.is_of_pipeline(variable):
            message = f"{what} is '{variable}', which belongs to the pipeline and not to the application"
            hint = f"to allow it, write environment: [{variable}] in dodo.yml"
            of.refuse(fields["environment"].span, message, hint)
        elif variable:
            message = f"{what} is empty in a test, as the variable '{variable}' has no value"
            hint = f"pass it with environment: [{variable}] in dodo.yml, or set it in .env"
            of.add(Diagnostic(fields["environment"].span, "application-secret", message, hint, "warning"))
        if not (isinstance(node, Mapping) and node.entries):
            of.bad(span, f"{what} has neither 'file' nor 'environment'", f"for example {name}: {{file: ./{name}.txt}}")
        return {"file": "/dev/null"}

    def check(self) -> list[Diagnostic]:
        """The problems of everything but the services, which are made already."""
        self.rest()
        self._top()
        for span, message, hint in nested(self):
            self.problems.append(Diagnostic(span, "application-isolation", message, hint))
        return self.problems

    def _top(self) -> None:
        known = ("services", "include", *_NAMED, *TOP_LEFT_OUT)
        of = Part(self, "the compose file", Span(str(self.application.path)))
        top = Mapping(Span(str(self.application.path)), dict(self.application.top))
        for key, entry in top.entries.items():
            if key not in known:
                hint = "indent it by 2: it looks like a service" if entries(entry.value).keys() & _OF_SERVICES else ""
                of.unknown_key(key, top, "the compose file", known, hint)
        for name, node, span in self._named("networks"):
            external = node.get("external") if isinstance(node, Mapping) else None
            if isinstance(external, Mapping) or (isinstance(external, Scalar) and is_true(external.value)):
                message = f"the network '{name}' is external, and a test has its own network only"
                of.add(Diagnostic(span, "application-key", message, severity="warning"))


def construction_of(application: ApplicationSource) -> Construction:
    """An application of any test, to be checked."""
    return Construction(application, Setting(1, "network", application.folder, limits=application.limits))


def checked_builds(application: ApplicationSource) -> dict[str, Any]:
    """A compose file with the builds alone: whole paths, and no variables; raises RequiredVariable.

    Variables whose values are not known are empty: each builder has others in the environment.
    """
    made = construction_of(application)
    services = {name: made.service(service) for name, service in application.services.items()}
    builds = {name: _whole(made, each["build"]) for name, each in services.items() if "build" in each}
    secrets = {name: _whole(made, about) for name, about in made.rest().get("secrets", {}).items()}
    text = {"services": {name: {"build": build} for name, build in builds.items()}}
    found: dict[str, Any] = compose_paths.mapped_texts(
        text | ({"secrets": secrets} if secrets else {}), lambda t: compose_paths.escaped(interpolate(t, {}))
    )
    return found


def _whole(made: Construction, about: dict[str, Any]) -> dict[str, Any]:
    def path(text: str) -> str:
        return (
            compose_paths.escaped(made.paths.whole(text.replace("$$", "$"))) if compose_paths.is_local(text) else text
        )

    found = {key: path(value) if key in ("context", "file") else value for key, value in about.items()}
    if others := about.get("additional_contexts"):
        found["additional_contexts"] = {name: path(value) for name, value in others.items()}
    return found
