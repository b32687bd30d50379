"""The application's part of a test, constructed from its compose files: services, volumes, secrets and configs.

Only what a test carries gets into it, so that nothing has to be looked for in it afterwards. Problems are collected
meanwhile, each at its place in the file: to check an application is to construct it.
"""

import os
import re
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from dodo_dsl.application import secret_variables
from dodo_dsl.application.container import TOP_LEFT_OUT, Container
from dodo_dsl.application.interpolation import escaped, interpolate, mapped_texts
from dodo_dsl.application.model import ApplicationSource, is_true
from dodo_dsl.application.mounts import COPY, Mount, nested, own_name
from dodo_dsl.application.part import Part
from dodo_dsl.diagnostics import Diagnostic, Span
from dodo_dsl.source import Mapping, Node, Scalar, entries, part
from dodo_dsl.spec.sandbox_limits import SandboxLimits

_NAMED = ("volumes", "secrets", "configs")
_OWN = "remove it, so that each test has its own"
_VOLUME = {
    "driver": ("reaches beyond the test", _OWN, "local"),
    "driver_opts": ("reaches beyond the test", "mount a folder of the repository, or use a tmpfs (type: tmpfs)"),
}
"""Keys of a volume without which it would be another one."""
_FILE = dict.fromkeys(
    ("driver", "driver_opts", "external", "template_driver"), ("is not the application's", "remove it")
)
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]*")
_OF_SERVICES = {"image", "build", "command", "x-dodo", "x-dodo-process"}


@dataclass(frozen=True)
class Setting:
    """What a test's copy of the application depends on; ``folder`` is the compiled test's.

    ``waits`` are the services of DoDo after which the application starts. Devices stay only with ``hil``, privileges
    only with ``privileged_allowed`` as well. ``limits`` is what a service gets that sets none, and ``given`` are
    variables that the test sets. With a ``time_seed``, the application's own time is the test's. ``bridge`` is the
    image of what stands between the bus and the application's ROS graph, with its flags.
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
    bridge: tuple[str, ...] = ()

    @property
    def own_network(self) -> bool:
        return self.isolation == "network"

    @property
    def keeps_privileges(self) -> bool:
        return self.hil and self.privileged_allowed


class Construction:
    """One test's application while it is made, with whole paths if it ``is_whole``.

    ``copies`` are volumes, each with the folder that it has at the start.
    ``shown`` are the paths of the host that it asks for, each with its place and the service that writes to it, if any.
    """

    def __init__(self, application: ApplicationSource, setting: Setting, *, is_whole: bool = False) -> None:
        self.application, self.setting, self._is_whole = application, setting, is_whole
        self.paths, self.ports = application.paths, application.access.ports
        self.base = os.path.relpath(application.folder, setting.folder)
        self.problems: list[Diagnostic] = []
        self.shown: list[tuple[str, Span, str]] = []
        self.copies: dict[str, str] = {}
        self._copied: dict[str, str] = {}
        self.volumes = {name: self._volume(name, node, span) for name, node, span in self._named("volumes")}
        self.containers = {name: Container(self, service) for name, service in application.services.items()}

    def _named(self, key: str) -> Iterator[tuple[str, Node, Span]]:
        top = self.application.top.get(key)
        for name, entry in (entries(top.value) if top else {}).items():
            yield name, entry.value, entry.key

    def rebased(self, path: str) -> str:
        if self._is_whole:
            return self.paths.whole(path)
        if path.startswith(("/", "~")):
            return path
        joined = os.path.normpath(f"{self.base}/{path}")
        return joined if joined.startswith(".") else f"./{joined}"

    def show(self, source: str, span: Span, writer: str = "") -> None:
        self.shown.append((source, span, writer))

    def copy(self, source: str) -> None:
        """Makes a volume of a folder of the repository to which a service writes.

        All services that mount the folder share its copy, so that none can lead the mount of another one elsewhere.
        """
        place = self.paths.names(source)[-1]
        is_kept = self.paths.is_writable(source) or not self.paths.is_own(source) or Path(place).is_file()
        if not is_kept and place not in self._copied:
            self._copied[place] = f"{COPY}{len(self.copies)}"
            self.copies[self._copied[place]] = escaped(self.rebased(source))

    def settled(self, mount: Mount) -> Mount:
        """A mount of the test: of a copy, or of the host's file or folder."""
        if not mount.is_own:
            return mount
        if name := self._copied.get(self.paths.names(mount.source)[-1]):
            return replace(mount, kind="volume", source=name, nocopy=True, is_required=False)
        read_only = mount.read_only or not self.paths.is_writable(mount.source)
        return replace(mount, source=self.rebased(mount.source), read_only=read_only)

    def services(self) -> dict[str, dict[str, Any]]:
        return {name: container.made() for name, container in self.containers.items()}

    def rest(self) -> dict[str, Any]:
        made = {
            key: {name: self._file(key, name, node, span) for name, node, span in self._named(key)}
            for key in ("secrets", "configs")
        }
        volumes = {own_name(name): made for name, made in self.volumes.items()} | {name: {} for name in self.copies}
        return {key: value for key, value in {"volumes": volumes, **made}.items() if value}

    def _volume(self, name: str, node: Node, span: Span) -> dict[str, Any]:
        of = Part(self, name, span, self.problems)
        fields = of.fields(node, f"the volume '{name}'", "external name", "labels", _VOLUME)
        external = fields.get("external")
        if external is None or (isinstance(external, Scalar) and not is_true(external.value)):
            return {}
        word = part(external, "name") or fields.get("name")
        called = (of.literal(word) if word else name) or name
        if called.startswith("dodo-") or not _NAME.fullmatch(called):
            of.refuse((word or node).span, f"'{called}' is not a name that a volume of the application may have", _OWN)
        return {"external": True, "name": called}

    def _file(self, key: str, name: str, node: Node, span: Span) -> dict[str, Any]:
        what, known = f"the {key[:-1]} '{name}'", self.application.known
        of = Part(self, what, span, self.problems)
        fields = of.fields(node, what, "file environment content", "labels name", _FILE)
        if "file" in fields:
            file = of.path(of.literal(fields["file"]), fields["file"].span)
            return {"file": file} if file else {}
        if "content" in fields and isinstance(text := fields["content"], Scalar):
            return {"content": text.text}
        variable = of.literal(fields["environment"]) if "environment" in fields else None
        if variable and self.application.is_late(variable):
            return {"environment": variable}
        if variable and variable in known and key == "configs":
            return {"content": escaped(known[variable])}
        if variable:
            hint = f"pass it with environment: [{variable}] in dodo.yml, or set it in .env"
            is_refused = secret_variables.is_of_pipeline(variable)
            rule = "application-isolation" if is_refused else "application-secret"
            message = f"{what} is empty in a test, as it has no variable '{variable}'"
            of.add(Diagnostic(fields["environment"].span, rule, message, hint, "error" if is_refused else "warning"))
        if not (isinstance(node, Mapping) and node.entries):
            of.bad(span, f"{what} has neither 'file' nor 'environment'", f"for example {name}: {{file: ./{name}.txt}}")
        return {"file": "/dev/null"}

    def check(self) -> list[Diagnostic]:
        self.rest()
        self._top()
        for span, message, hint in nested(self):
            self.problems.append(Diagnostic(span, "application-isolation", message, hint))
        return self.problems

    def _top(self) -> None:
        known = ("services", "include", *_NAMED, *TOP_LEFT_OUT)
        of = Part(self, "the compose file", Span(str(self.application.path)), self.problems)
        top = Mapping(Span(str(self.application.path)), dict(self.application.top))
        for key, entry in top.entries.items():
            if key not in known:
                hint = "indent it by 2: it looks like a service" if entries(entry.value).keys() & _OF_SERVICES else ""
                of.unknown_key(key, top, "the compose file", known, hint)


def checked_builds(application: ApplicationSource) -> dict[str, Any]:
    """A compose file with the builds alone: whole paths, and no variables; raises RequiredVariable.

    Variables whose values are not known are empty: each builder has others in the environment.
    """
    made = Construction(application, Setting(1, "network", application.folder), is_whole=True)
    builds = {name: {"build": each["build"]} for name, each in made.services().items() if "build" in each}
    secrets = made.rest().get("secrets")
    document = {"services": builds} | ({"secrets": secrets} if secrets else {})
    found: dict[str, Any] = mapped_texts(document, lambda text: escaped(interpolate(text, {})))
    return found
