"""From specs without errors to Plans."""

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from dodo_dsl.diagnostics import Diagnostic, Span
from dodo_dsl.plan import addresses
from dodo_dsl.plan.application import ApplicationSource, plan_application
from dodo_dsl.plan.files import Copy, FilesError, copies
from dodo_dsl.plan.model import Flag, Place, Plan, Service, Suite
from dodo_dsl.source import Entry
from dodo_dsl.spec.deployment import Deployment
from dodo_dsl.spec.manifest import Manifest, Parameter
from dodo_dsl.spec.model import Spec, Use
from dodo_dsl.spec.values import Value, convert, default_value

RECORDER = "dodo-recorder"
RECORDING = "test.rec"


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
    ordered = sorted(specs, key=lambda s: s.name or "")
    try:
        cids = addresses.cids([s.isolation for s in ordered], deployment.cids)
    except addresses.OutOfAddresses as error:
        span = Span(str(deployment.file)) if deployment.file else ordered[-1].span("name")
        problem = Diagnostic(span, "out-of-cids", str(error), "widen 'cids' in dodo.yml")
        return Compiled(Suite(()), {}), [problem]
    builders = [
        _Builder(spec, manifests, deployment, out, cid, index)
        for index, (spec, cid) in enumerate(zip(ordered, cids, strict=True))
    ]
    plans = tuple(builder.plan(application) for builder in builders)
    files = {plan.slug: tuple(sorted(b.files)) for plan, b in zip(plans, builders, strict=True)}
    problems = list(itertools.chain.from_iterable(b.problems for b in builders))
    return Compiled(Suite(plans, deployment.gates), files), problems


class _Builder:
    def __init__(
        self,
        spec: Spec,
        manifests: Mapping[str, Manifest],
        deployment: Deployment,
        out: Path,
        cid: int,
        index: int,
    ) -> None:
        self.spec = spec
        self.manifests = manifests
        self.deployment = deployment
        self.out = out
        self.cid = cid
        self.index = index
        self.files: set[Copy] = set()
        self.problems: list[Diagnostic] = []
        self.places: dict[str, Place] = {}

    def plan(self, application: ApplicationSource) -> Plan:
        spec = self.spec
        name = spec.name or spec.location.stem
        services = (*self._recorder(), *(self._service(use) for use in spec.uses))
        self._names_apart(services, application)
        judges = tuple(s.name for s in services if s.judge)
        for key in ("level", "kind", "timeout", "clock", "seed", "isolation"):
            if key in spec.spans:
                self._place(key, spec.span(key))
        on_network = spec.isolation == "network"
        return Plan(
            name=name,
            slug=name,
            spec=self._shown(spec.path),
            description=spec.description or "",
            level=spec.level or "",
            kind=spec.kind or "",
            timeout_s=spec.timeout_s or 0.0,
            clock=spec.clock,
            isolation=spec.isolation,
            seed=spec.seed,
            cid=self.cid,
            subnet=addresses.subnet(self.index, self.deployment.subnets) if on_network else "",
            tag="sil" if spec.level in ("sil", "dil") else "hil-dynamic",
            sandbox_image=self._image("sandbox"),
            services=services,
            application=plan_application(application, self.cid, spec.isolation, self.out / name, judges),
            source_map=self.places,
        )

    def _place(self, key: str, span: Span) -> None:
        self.places[key] = Place(self._shown(Path(span.file)), span.line, span.column)

    def _shown(self, path: Path) -> str:
        """A spec's path as its repository has it; outside a deployment, as its registry does."""
        root = self.deployment.root if self.deployment.file else self.spec.location.root
        return path.relative_to(root if path.is_relative_to(root) else self.spec.location.root).as_posix()

    def _image(self, image: str) -> str:
        bare = "/" not in image and ":" not in image
        return f"{self.deployment.image_prefix}/{image}:{self.deployment.image_tag}" if bare else image

    def _recorder(self) -> list[Service]:
        manifest = self.manifests["rec-recorder"]
        flags = (Flag("rec", RECORDING, "report"), Flag("cid", str(self.cid)))
        image = self._image(manifest.image)
        return [Service("environment", RECORDER, manifest.name, image, manifest.process, flags)]

    def _names_apart(self, services: Sequence[Service], application: ApplicationSource) -> None:
        for service in services:
            if service.name in application.spans:
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
        return Service(
            use.layer,
            use.name,
            manifest.name,
            self._image(manifest.image),
            manifest.process,
            tuple(flags),
            judge=use.layer == "evaluation",
        )

    def _flag(self, use: Use, parameter: Parameter, key: str) -> Flag | None:
        entry = use.parameters.get(parameter.name) or self._shared(use, parameter)
        root = self.spec.location.root
        value = convert(parameter, entry.value, root) if entry else default_value(parameter)
        if entry:
            self._place(key, entry.key)
        if value is None:
            return None
        if value.path is not None and entry:
            return self._file_flag(parameter, value, entry.key)
        return Flag(parameter.name, value.text, value.kind)

    def _shared(self, use: Use, parameter: Parameter) -> Entry | None:
        """The entry that another service gives to a shared parameter."""
        if not parameter.shared:
            return None
        for other in self.spec.uses:
            if other is not use and parameter.name in other.parameters:
                return other.parameters[parameter.name]
        return None

    def _file_flag(self, parameter: Parameter, value: Value, span: Span) -> Flag:
        path = value.path or Path()
        root = self.spec.location.root.resolve()
        try:
            self.files.update(copies(path, root))
        except FilesError as error:
            self.problems.append(Diagnostic(span, "path-escape", str(error)))
        return Flag(parameter.name, path.relative_to(root).as_posix(), "path")
