"""What a rule sees, and the shape of a rule."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Protocol

from dodo_dsl.diagnostics import Diagnostic
from dodo_dsl.spec.manifest import Manifest
from dodo_dsl.spec.model import Spec, Use


@dataclass(frozen=True)
class Context:
    """One spec with all manifests, and the other specs by name."""

    spec: Spec
    manifests: Mapping[str, Manifest]
    by_name: Mapping[str, list[Spec]]

    def known_uses(self) -> Iterator[tuple[Use, Manifest]]:
        """The services whose manifest is known; the others are a rule's business of their own."""
        for use in self.spec.uses:
            manifest = self.manifests.get(use.uses.text)
            if manifest:
                yield use, manifest


class Rule(Protocol):
    def __call__(self, context: Context) -> Iterator[Diagnostic]: ...
