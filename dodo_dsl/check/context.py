"""What a rule sees, and the shape of a rule."""

import functools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from dodo_dsl.diagnostics import Diagnostic, Span
from dodo_dsl.opendlv.odvd import STANDARD, parser
from dodo_dsl.spec.deployment import Deployment
from dodo_dsl.spec.manifest import Manifest
from dodo_dsl.spec.model import Spec, Use
from dodo_dsl.spec.rig import Rig


class Declared(Protocol):
    """What an application's service declares under ``x-dodo``: names of messages, each with its place."""

    @property
    def inputs(self) -> tuple[tuple[str, Span], ...]: ...
    @property
    def outputs(self) -> tuple[tuple[str, Span], ...]: ...
    @property
    def answers(self) -> tuple[tuple[str, Span], ...]: ...
    @property
    def done(self) -> tuple[str, Span] | None: ...
    @property
    def readers(self) -> int: ...


@dataclass(frozen=True)
class Context:
    """One instance with all manifests, one instance of each file by name, and what the application declares."""

    spec: Spec
    manifests: Mapping[str, Manifest]
    by_name: Mapping[str, list[Spec]]
    deployment: Deployment
    declared: Mapping[str, Declared | None] | None = None

    @property
    def rig(self) -> Rig | None:
        """The rig of a hil test, when the deployment has it."""
        return self.deployment.rig(self.spec.rig) if self.spec.rig else None

    @property
    def messages(self) -> frozenset[str]:
        """The full names of all messages: OpenDLV's, DoDo's and the deployment's."""
        return known_messages(self.deployment.messages)

    def known_uses(self) -> Iterator[tuple[Use, Manifest]]:
        """The services whose manifest is known; the others are a rule's business of their own."""
        for use in self.spec.uses:
            manifest = self.manifests.get(use.uses.text)
            if manifest:
                yield use, manifest


@functools.cache
def known_messages(own: tuple[Path, ...]) -> frozenset[str]:
    """The names of the standard messages and of those in a deployment's files, as far as these can be read."""
    names = {d.name for d in parser.load(STANDARD)}
    for path in own:
        try:
            names.update(d.name for d in parser.load(path))
        except parser.OdvdError:
            continue  # the deployment's own diagnostic
    return frozenset(names)


class Rule(Protocol):
    def __call__(self, context: Context) -> Iterator[Diagnostic]: ...
