"""From specs without errors to Plans."""

import functools
import itertools
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import msgspec

from dodo_dsl.application import hidden_paths
from dodo_dsl.application.construction import Setting
from dodo_dsl.application.model import ApplicationSource
from dodo_dsl.application.ros_topics import BRIDGE_IMAGE
from dodo_dsl.check import ros_topics
from dodo_dsl.check import senders as check_senders
from dodo_dsl.check.file_rules import MAP, needed
from dodo_dsl.check.resolve import WITHOUT, ResolvedTest, isolation
from dodo_dsl.check.senders import senders, truth
from dodo_dsl.check.spec_rules import containers, resolved_goals
from dodo_dsl.diagnostics import Span
from dodo_dsl.plan import added_services, addresses
from dodo_dsl.plan.added_services import DRAWN, hardware, lockstep
from dodo_dsl.plan.application import plan_application
from dodo_dsl.plan.model import ENDS_INPUT, Application, Flag, Place, Plan, PlannedService, Pooled, Suite, is_device
from dodo_dsl.plan.test_files import FileCopy, FilesError, standing_once
from dodo_dsl.spec.arguments import Argument, ResolvedService
from dodo_dsl.spec.deployment import Deployment
from dodo_dsl.spec.load import Settings, of_test
from dodo_dsl.spec.manifest import Manifest, Parameter
from dodo_dsl.spec.model import LAYERS
from dodo_dsl.spec.rig import EMULATED, EMULATED_FILE, PORT, SIMULATION_TAG
from dodo_dsl.spec.sandbox_limits import SandboxLimits

_MOST_OF_TOPICS = 120_000
"""Bytes of what the ROS bridge is started with: Linux takes 131,072 in one word."""


@dataclass(frozen=True)
class Compiled:
    suite: Suite
    copies: Mapping[str, tuple[FileCopy, ...]]


def build(
    tests: Sequence[ResolvedTest],
    manifests: Mapping[str, Manifest],
    deployment: Deployment,
    application: ApplicationSource,
    out: Path,
    settings: Settings,
) -> Compiled:
    """The Plans of tests that ``check`` found no errors in; ``out`` is the folder that they will be written below."""
    ordered = sorted(tests, key=lambda test: test.spec.slug)
    cids = addresses.of_tests(ordered, deployment, application)
    specs = {test.spec.path: test.spec.location.root for test in ordered}
    hidden = hidden_paths.folders(application, deployment, specs.values())
    shared = _Shared(
        manifests,
        deployment,
        application,
        settings,
        out / "test",
        functools.cache(lambda setting: replace(plan_application(application, setting), hidden=hidden)),
        addresses.Subnets(deployment.subnets),
        _import_paths(deployment, out / "test"),
        _limits(application, deployment),
    )
    builders = [_Builder(test, cid, shared) for test, cid in zip(ordered, cids, strict=True)]
    plans = [builder.plan() for builder in builders]
    files = standing_once({plan.slug: tuple(sorted(b.files)) for plan, b in zip(plans, builders, strict=True)})
    plans = [replace(p, shared={copy.target: copy.shared for copy in files[p.slug] if copy.shared}) for p in plans]
    named = itertools.chain.from_iterable(builder.named for builder in builders)
    if more := hidden_paths.files(application, deployment, specs.values(), {*specs, *named}):
        if len(more) > hidden_paths.MOST:
            what = (
                f"{len(more):,} files of tests lie among the application's own, expected at most {hidden_paths.MOST:,}"
            )
            raise FilesError(f"{what}: keep tests in a folder of theirs ('registry' in dodo.yml)")
        plans = [replace(p, application=replace(p.application, hidden=(*hidden, *more))) for p in plans]
    return Compiled(Suite(tuple(plans), deployment.gates), files)


def _limits(application: ApplicationSource, deployment: Deployment) -> SandboxLimits:
    """The deployment's limits, with what may be read relative to the application's folder."""
    limits, base = deployment.sandbox, application.folder.resolve()
    root = deployment.root.resolve()
    reads = [
        path if path.startswith(("/", "~")) else Path(os.path.relpath(root / path, base)).as_posix()
        for path in limits.reads
    ]
    return replace(limits, reads=tuple(reads))


def _import_paths(deployment: Deployment, folder: Path) -> tuple[str, ...]:
    """The folders above those of own services, where their packages are found, relative to a compiled test's."""
    above = dict.fromkeys(services.resolve().parent for services in deployment.services)
    return tuple(Path(os.path.relpath(path, folder)).as_posix() for path in above)


@dataclass(frozen=True)
class _Shared:
    """What the tests of a suite share; ``folder`` stands for a compiled test's, as all lie side by side.

    ``rewritten`` has the application in a setting.
    """

    manifests: Mapping[str, Manifest]
    deployment: Deployment
    application: ApplicationSource
    settings: Settings
    folder: Path
    rewritten: Callable[[Setting], Application]
    subnets: addresses.Subnets
    imports: tuple[str, ...]
    limits: SandboxLimits
    real: Callable[[Path], Path] = field(default_factory=lambda: functools.cache(Path.resolve))


class _Builder:
    def __init__(self, test: ResolvedTest, cid: int, shared: _Shared) -> None:
        self.test, self.spec, self.rig = test, test.spec, test.rig
        self.cid = cid
        self.shared = shared
        self.manifests, self.deployment, self.application = shared.manifests, shared.deployment, shared.application
        self.files: set[FileCopy] = set()
        self.named: set[Path] = set()
        """What the spec names, and what that names: files of tests among the application's own, if it lies there."""
        self.places: dict[str, Place] = {}
        self.shown: dict[str, str] = {}

    def plan(self) -> Plan:
        spec, rig = self.spec, self.rig
        automatic = tuple(self._automatic())
        services = (*automatic, *(self._service(service) for service in self.test.services))
        evaluators = tuple(s.name for s in services if s.judge)
        for key, span in spec.spans.items():
            if key not in LAYERS:
                self._place(key, span)
        for name, entry in spec.variables.items():
            self._place(f"application.env.{name}", entry.key)
        for service in self.application.services.values():
            started = service.node.entries.get("x-dodo-process")
            span = started.key if started else service.span
            if not Path(self._shown(Path(span.file))).is_absolute():
                self._place(f"application.{service.name}", span)
        isolated = isolation(spec, rig)
        setting = Setting(
            self.cid,
            isolated,
            self.shared.folder,
            evaluators,
            hil=rig is not None and not rig.is_emulated,
            privileged_allowed=rig is not None and rig.privileged,
            limits=self.shared.limits,
            given=tuple(self.test.variables.items()),
            time_seed=spec.seed if spec.is_stepped and isolated == "network" else None,
            bridge=(self._image(BRIDGE_IMAGE), *self._bridge()) if self.application.speaks_ros else (),
        )
        messages = self._messages()
        return Plan(
            name=spec.title,
            slug=spec.slug,
            spec=self._shown(spec.path),
            description=spec.description or "",
            level=spec.level or "",
            kind=spec.kind or "",
            timeout_s=spec.timeout_s or 0.0,
            clock=spec.clock,
            isolation=isolated,
            seed=spec.seed,
            cid=self.cid,
            subnet=self.shared.subnets.give(spec.slug, containers(self.test, self.application))
            if isolated == "network"
            else "",
            tag=rig.tag if rig else SIMULATION_TAG,
            sandbox_image=self._image("sandbox"),
            services=services,
            application=self.shared.rewritten(setting),
            lockstep=lockstep(spec, self.application.declared, self.shared.settings.wall_timeout_s),
            resources=spec.resources,
            rig=rig.name if rig else "",
            emulated=rig is not None and rig.is_emulated,
            more_tags=rig.more_tags if rig else (),
            pool=self._pooled() if spec.pool else None,
            messages=messages,
            senders=senders(self.test),
            truth=truth(self.test),
            world=check_senders.services(self.test, tuple(service.name for service in automatic)),
            told=tuple(dict.fromkeys(str(end.port) for end in check_senders.told(self.test.wiring))),
            goals=resolved_goals(self.test)[0],
            headline=spec.headline,
            import_paths=self.shared.imports,
            source_map=self.places,
        )

    def _bridge(self) -> Iterator[str]:
        graph = ros_topics.graph(self.test.wiring.topics)
        yield from dict.fromkeys(f"--name={topic.bus[0]}" for topic in graph.given if topic.camera)
        own = {
            "types": dict(itertools.starmap(_ros_type, enumerate(self.deployment.ros_types))),
            "messages": "\n".join(path.read_text(encoding="utf-8") for path in self.deployment.messages),
        }
        text = msgspec.json.encode(msgspec.structs.replace(graph, **own)).decode()
        if len(text) > _MOST_OF_TOPICS:
            what = f"topics with the files of 'messages' in dodo.yml take {len(text):,} bytes"
            raise FilesError(f"{what}, expected at most {_MOST_OF_TOPICS:,}: name fewer files")
        yield f"--topics={text}"

    def _pooled(self) -> Pooled:
        test = of_test(self.spec)
        return Pooled(test.title, test.slug)

    def _messages(self) -> tuple[str, ...]:
        targets = [f"messages/{number}-{path.name}" for number, path in enumerate(self.deployment.messages)]
        self.files.update(
            FileCopy(t, path.resolve()) for t, path in zip(targets, self.deployment.messages, strict=True)
        )
        return tuple(targets)

    def _place(self, key: str, span: Span) -> None:
        if span.file == EMULATED_FILE:
            return  # built in, so it has no place
        shown = self.shown.get(span.file)
        if shown is None:
            shown = self.shown[span.file] = self._shown(Path(span.file))
        self.places[key] = Place(shown, span.line, span.column)

    def _shown(self, path: Path) -> str:
        """A file's path as its repository has it; outside a deployment, as its registry does; else the whole one."""
        roots = [self.deployment.root] if self.deployment.file else []
        inside = [root for root in (*roots, self.spec.location.root) if path.is_relative_to(root)]
        return (path.relative_to(inside[0]) if inside else path).as_posix()

    def _image(self, image: str) -> str:
        bare = "/" not in image and ":" not in image
        return f"{self.deployment.image_prefix}/{image}:{self.deployment.image_tag}" if bare else image

    def _automatic(self) -> Iterator[PlannedService]:
        own = self.manifests[added_services.RECORDER_MANIFEST]
        yield added_services.recorder(self.test, own, self._image(own.image), self.cid)
        if self.spec.is_stepped:
            own = self.manifests[added_services.CLOCK_MANIFEST]
            watch = (added_services.RECORDER,)
            yield added_services.clock(
                self.test, own, self._image(own.image), watch, self.cid, tuple(self.application.services)
            )

    def _service(self, service: ResolvedService) -> PlannedService:
        use, manifest = service.use, service.manifest
        key = f"{use.layer}.{use.name}"
        self._place(key, use.span)
        flags = [
            flag
            for argument in service.arguments.values()
            if (flag := self._flag(argument, f"{key}.{argument.parameter.name}")) is not None
        ]
        flags = [_leaving_out(flag, self.test.left_out.get(use.name, ())) for flag in flags]
        flags.append(Flag("cid", str(self.cid)))
        if use.name == self.spec.until:
            flags.append(Flag(ENDS_INPUT, "true"))
        planned = PlannedService(
            use.layer,
            use.name,
            manifest.name,
            self._image(manifest.image),
            manifest.process,
            tuple(flags),
            judge=use.layer == "evaluation",
            devices=_devices(service),
            setup_s=_setup_s(flags, manifest),
            port=_port(service),
        )
        return hardware(planned, self.manifests, self._image(self.manifests[DRAWN].image))

    def _flag(self, argument: Argument, key: str) -> Flag | None:
        entry, value = argument.entry, argument.value
        if entry:
            self._place(key, entry.key)
        if value is None:
            return None
        if value.path is not None and entry:
            return self._file_flag(argument.parameter, value.path)
        return Flag(argument.parameter.name, value.text, value.kind)

    def _file_flag(self, parameter: Parameter, path: Path) -> Flag:
        real, found = self.shared.real, needed(parameter, path, self.spec.location.root)
        if isinstance(found, str):
            raise FilesError(found)
        self.files.update(itertools.starmap(FileCopy, found.items()))
        folder = path.parent if parameter.format == "map" and path.suffix == ".json" else path
        is_around = real(self.application.folder).is_relative_to(real(folder))
        self.named.update((real(path), real(folder) / MAP) if is_around else (real(folder), *found.values()))
        return Flag(parameter.name, path.relative_to(real(self.spec.location.root)).as_posix(), "path")


def _ros_type(number: int, path: Path) -> tuple[str, str]:
    from dodo_dsl.opendlv.ros_codec import own_name

    name = f"{number}/{path.name}" if path.suffix == ".idl" else f"{own_name(path)}.msg"
    return name, path.read_text(encoding="utf-8")


def _leaving_out(flag: Flag, messages: Sequence[str]) -> Flag:
    if flag.name != WITHOUT or not messages:
        return flag
    return replace(flag, value=",".join([*(word for word in flag.value.split(",") if word), *messages]))


def _devices(service: ResolvedService) -> tuple[str, ...]:
    """The device files among those that the manifest names; a rig's camera may have none (rpicam, a recording)."""
    named = (service.texts.get(device.strip("{}"), device) for device in service.manifest.devices)
    return tuple(device for device in named if is_device(device))


def _port(service: ResolvedService) -> str:
    """The port of the rig that a service moves, as its manifest declares; empty for the emulated rig."""
    found = (a.text for a in service.arguments.values() if a.parameter.rig == PORT)
    return next((port for port in found if port and port != EMULATED), "")


def _setup_s(flags: Sequence[Flag], manifest: Manifest) -> float:
    """The seconds beyond ``READY_S`` that a service may take to get ready: durations with ``setup-times``."""
    times = {name: parameter.setup_times for name, parameter in manifest.parameters.items()}
    return sum((times[flag.name] * float(flag.value) for flag in flags if times.get(flag.name)), 0.0)
