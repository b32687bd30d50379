"""The input of a rule, and its signature."""

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from typing import Protocol

from dodo_dsl.application.model import ApplicationSource
from dodo_dsl.check.resolve import ResolvedTest, known_ids
from dodo_dsl.check.wiring import Wiring
from dodo_dsl.diagnostics import Diagnostic
from dodo_dsl.spec.arguments import ResolvedService
from dodo_dsl.spec.deployment import Deployment
from dodo_dsl.spec.manifest import Manifest
from dodo_dsl.spec.model import Spec
from dodo_dsl.spec.rig import Rig


@dataclass(frozen=True)
class RuleContext:
    """One instance with its deployment and application; ``by_name`` has one instance of each file by its name."""

    test: ResolvedTest
    manifests: Mapping[str, Manifest]
    by_name: Mapping[str, list[Spec]]
    deployment: Deployment
    application: ApplicationSource | None = None

    @property
    def spec(self) -> Spec:
        return self.test.spec

    @property
    def rig(self) -> Rig | None:
        """The rig of a hil test, when the deployment has it."""
        return self.test.rig

    @property
    def services(self) -> tuple[ResolvedService, ...]:
        """Those that are known in their layers; ``unknown-service`` and ``wrong-layer`` report the others."""
        return self.test.services

    @property
    def wiring(self) -> Wiring:
        return self.test.wiring

    @property
    def messages(self) -> Collection[str]:
        """The full names of all messages: OpenDLV's, DoDo's and the deployment's, as far as these can be read."""
        return known_ids(self.deployment.messages)


class Rule(Protocol):
    def __call__(self, context: RuleContext) -> Iterator[Diagnostic]: ...
