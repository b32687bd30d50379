"""From specs without errors to Plans."""

import functools
import itertools
from collections.abc import Callable, Container, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from dodo_dsl.application.model import ApplicationSource
from dodo_dsl.check.context import Context
from dodo_dsl.diagnostics import Diagnostic, Span
from dodo_dsl.plan import addresses
from dodo_dsl.plan.clock_service import clock, lockstep
from dodo_dsl.plan.emulated_rig import DRAWN, hardware
from dodo_dsl.plan.model import Application, Flag, Place, Plan, Service, Suite, is_device
from dodo_dsl.plan.recorder_service import MANIFEST, RECORDER, recorder
from dodo_dsl.plan.rewrite.rewrite import plan_application
from dodo_dsl.plan.test_files import Copy, FilesError, copies
from dodo_dsl.spec import arguments
from dodo_dsl.spec.deployment import Deployment
from dodo_dsl.spec.manifest import Manifest, Parameter
from dodo_dsl.spec.model import Spec, Use
from dodo_dsl.spec.rig import EMULATED_FILE, Rig
from dodo_dsl.spec.values import Value, convert, default_value


@dataclass(frozen=True)
class Compiled:
    """A suite with the files that each test needs, by slug."""

    suite: Suite
    copies: Mapping[str, tuple[Copy, ...]]


def build(
    specs: Sequence[Spec],
    manifests: Mapping[str, Manifest],
    deployment: Deployment,
    application: ApplicationSource,
    out: Path,
) -> tuple[Compiled, list[Diagnostic]]:
    """The Plans of specs that ``check`` found no errors in; ``out`` is the folder that they will be written below."""
    ordered = sorted(specs, key=lambda s: s.slug)
    try:
        cids = _cids(ordered, deployment)
    except addresses.OutOfAddresses as error:
        span = Span(str(deployment.file)) if deployment.file else ordered[-1].span("name")
        problem = Diagnostic(span, "out-of-cids", str(error), "widen 'cids' in dodo.yml")
        return Compiled(Suite(()), {}), [problem]
    tree = functools.cache(copies)  # tests share maps and recordings

    @functools.cache
    def planned(cid: int, isolated: str, judges: tuple[str, ...], hardware: bool, privileged: bool) -> Application:
        kept = {"hil": hardware, "privileged_allowed": privileged}
        return plan_application(application, cid, isolated, out / "test", judges, **kept)

    builders = [
        _Builder(spec, manifests, deployment, out, cid, index, tree, planned)
        for index, (spec, cid) in enumerate(zip(ordered, cids, strict=True))
    ]
    plans = tuple(builder.plan(application) for builder in builders)
    files = {plan.slug: tuple(sorted(b.files)) for plan, b in zip(plans, builders, strict=True)}
    problems = list(itertools.chain.from_iterable(b.problems for b in builders))
    return Compiled(Suite(plans, deployment.gates), files), problems


def _cids(specs: Sequence[Spec], deployment: Deployment) -> list[int]:
    """A CID for each instance: its rig's, or one of the deployment's range."""
    rigs = [deployment.rig(spec.rig) if spec.rig else None for spec in specs]
    free = [i for i, rig in enumerate(rigs) if rig is None or rig.cid is None]
    given = addresses.cids([isolation(specs[i], rigs[i]) for i in free], deployment.cids)
    by_index = dict(zip(free, given, strict=True))
    return [by_index[i] if rig is None or rig.cid is None else rig.cid for i, rig in enumerate(rigs)]


def isolation(spec: Spec, rig: Rig | None) -> str:
    """What the spec writes, else what its rig needs, else a network of its own."""
    return spec.isolation or (rig.isolation if rig else "network")


class _Builder:
    def __init__(
        self,
        spec: Spec,
        manifests: Mapping[str, Manifest],
        deployment: Deployment,
        out: Path,
        cid: int,
        index: int,
        tree: Callable[[Path, Path], list[Copy]],
        application: Callable[[int, str, tuple[str, ...], bool, bool], Application],
    ) -> None:
        self.spec = spec
        self.manifests = manifests
        self.deployment = deployment
        self.out = out
        self.cid = cid
        self.index = index
        self.rig = deployment.rig(spec.rig) if spec.rig else None
        self.tree = tree
        self.application = application
        self.files: set[Copy] = set()
        self.problems: list[Diagnostic] = []
        self.places: dict[str, Place] = {}
        self.shown: dict[str, str] = {}

    def plan(self, application: ApplicationSource) -> Plan:
        """The instance's Plan with this application."""
        spec, rig = self.spec, self.rig
        uses = (self._service(use) for use in spec.uses)
        services = (*self._automatic(application), *uses)
        self._names_apart(services, application.spans)
        judges = tuple(s.name for s in services if s.judge)
        for key in ("name", "level", "kind", "timeout", "clock", "rig", "matrix", "seed", "isolation", "record"):
            if key in spec.spans:
                self._place(key, spec.span(key))
        isolated = isolation(spec, rig)
        hardware = rig is not None and not rig.is_emulated
        privileged = rig is not None and rig.privileged
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
            subnet=addresses.subnet(self.index, self.deployment.subnets) if isolated == "network" else "",
            tag=rig.tag if rig else "sil",
            sandbox_image=self._image("sandbox"),
            services=services,
            application=self.application(self.cid, isolated, judges, hardware, privileged),
            lockstep=lockstep(spec, application.declared),
            rig=rig.name if rig else "",
            messages=messages,
            source_map=self.places,
        )

    def _messages(self) -> tuple[str, ...]:
        """The deployment's messages, copied beside the test for its services to read."""
        targets = [f"messages/{number}-{path.name}" for number, path in enumerate(self.deployment.messages)]
        self.files.update(Copy(t, path.resolve()) for t, path in zip(targets, self.deployment.messages, strict=True))
        return tuple(targets)

    def _place(self, key: str, span: Span) -> None:
        if span.file == EMULATED_FILE:
            return  # built in, nobody wrote it
        shown = self.shown.get(span.file)
        if shown is None:
            shown = self.shown[span.file] = self._shown(Path(span.file))
        self.places[key] = Place(shown, span.line, span.column)

    def _shown(self, path: Path) -> str:
        """A spec's path as its repository has it; outside a deployment, as its registry does."""
        root = self.deployment.root if self.deployment.file else self.spec.location.root
        return path.relative_to(root if path.is_relative_to(root) else self.spec.location.root).as_posix()

    def _image(self, image: str) -> str:
        bare = "/" not in image and ":" not in image
        return f"{self.deployment.image_prefix}/{image}:{self.deployment.image_tag}" if bare else image

    def _automatic(self, application: ApplicationSource) -> Iterator[Service]:
        """The services that DoDo adds: the recorder, and in lockstep the clock."""
        spec, manifests = self.spec, self.manifests
        image = self._image(manifests[MANIFEST].image)
        yield recorder(spec, manifests, self.rig, image, self.cid)
        if spec.clock == "lockstep":
            context = Context(spec, manifests, {}, self.deployment, application.declared)
            yield clock(context, self._image(manifests["clock"].image), (RECORDER,), self.cid)

    def _names_apart(self, services: Sequence[Service], application: Container[str]) -> None:
        for service in services:
            if service.name in application:
                use = next(u for u in self.spec.uses if u.name == service.name)
                message = f"the application has a service '{service.name}' too"
                self.problems.append(Diagnostic(use.span, "service-taken", message, "rename the one in the test"))

    def _service(self, use: Use) -> Service:
        manifest = self.manifests[use.uses.text]
        key = f"{use.layer}.{use.name}"
        self._place(key, use.span)
        flags = [
            flag
            for parameter in manifest.parameters.values()
            if (flag := self._flag(use, parameter, f"{key}.{parameter.name}")) is not None
        ]
        flags.append(Flag("cid", str(self.cid)))
        service = Service(
            use.layer,
            use.name,
            manifest.name,
            self._image(manifest.image),
            manifest.process,
            tuple(flags),
            judge=use.layer == "evaluation",
            devices=self._devices(use, manifest),
            setup_s=_setup_s(flags, manifest),
        )
        return hardware(service, self.manifests, self._image(self.manifests[DRAWN].image))

    def _devices(self, use: Use, manifest: Manifest) -> tuple[str, ...]:
        """The device files among what the manifest names; a rig's camera may be none (rpicam, a recording)."""
        values = arguments.texts(self.spec, use, manifest, self.rig)
        named = (values.get(device.strip("{}"), device) for device in manifest.devices)
        return tuple(device for device in named if is_device(device))

    def _flag(self, use: Use, parameter: Parameter, key: str) -> Flag | None:
        entry = arguments.written(self.spec, use, parameter, self.rig)
        root = self.spec.location.root
        value = convert(parameter, entry.value, root) if entry else default_value(parameter)
        if entry:
            self._place(key, entry.key)
        if value is None:
            return None
        if value.path is not None and entry:
            return self._file_flag(parameter, value, entry.key)
        return Flag(parameter.name, value.text, value.kind)

    def _file_flag(self, parameter: Parameter, value: Value, span: Span) -> Flag:
        path = value.path or Path()
        root = self.spec.location.root.resolve()
        try:
            self.files.update(self.tree(path, root))
        except FilesError as error:
            self.problems.append(Diagnostic(span, "path-escape", str(error)))
        return Flag(parameter.name, path.relative_to(root).as_posix(), "path")


def _setup_s(flags: Sequence[Flag], manifest: Manifest) -> float:
    """How much longer than others a service may take to get ready, by the durations that its manifest marks."""
    times = {name: parameter.setup_times for name, parameter in manifest.parameters.items()}
    return sum((times[flag.name] * float(flag.value) for flag in flags if times.get(flag.name)), 0.0)
