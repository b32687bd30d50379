"""An instance resolved: arguments converted and wiring computed once, for rules, planner and ``dodo explain`` alike."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from dodo_dsl.application.model import ApplicationSource
from dodo_dsl.check.replayed import replayed
from dodo_dsl.check.wiring import Wiring, wire
from dodo_dsl.spec.arguments import Argument, ResolvedService, resolved
from dodo_dsl.spec.deployment.deployment import Deployment
from dodo_dsl.spec.deployment.rig import Rig
from dodo_dsl.spec.manifest import Manifest
from dodo_dsl.spec.model import Spec


@dataclass(frozen=True)
class ResolvedTest:
    """One instance with its rig, the services whose manifests are known, and its wiring with the application.

    ``left_out`` are messages that services which play recordings leave out, as they are the application's.
    """

    spec: Spec
    rig: Rig | None
    services: tuple[ResolvedService, ...]
    wiring: Wiring
    left_out: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    @property
    def is_complete(self) -> bool:
        """Whether every service of the spec has a manifest."""
        return len(self.services) == len(self.spec.uses)


def resolve(
    specs: Iterable[Spec],
    manifests: Mapping[str, Manifest],
    deployment: Deployment,
    application: ApplicationSource | None,
) -> list[ResolvedTest]:
    """Each instance resolved, in the order given; instances of one file that follow each other share what is equal."""
    declared = application.declared if application else None
    found: list[ResolvedTest] = []
    for spec in specs:
        previous = found[-1] if found and found[-1].spec.path == spec.path else None
        rig = deployment.rig(spec.rig) if spec.rig else None
        services = tuple(
            resolved(spec, use, manifest, rig, _arguments(previous, use.layer, use.name))
            for use in spec.uses
            if (manifest := manifests.get(use.uses.text)) is not None
        )
        played = replayed(wire(services, declared), services, deployment.messages)
        found.append(ResolvedTest(spec, rig, services, played.wiring, played.left_out))
    return found


def _arguments(test: ResolvedTest | None, layer: str, name: str) -> Mapping[str, Argument] | None:
    services = test.services if test else ()
    return next((s.arguments for s in services if (s.use.layer, s.use.name) == (layer, name)), None)
