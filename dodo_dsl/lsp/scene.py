"""A document in its project, as hover, completion and definitions look at it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from dodo_dsl.check.resolve import ResolvedTest
from dodo_dsl.lsp.positions import Lines
from dodo_dsl.lsp.project import Project
from dodo_dsl.lsp.texts import parse_text
from dodo_dsl.lsp.tree import DocumentPlace, Steps, below, text_of
from dodo_dsl.source import Node
from dodo_dsl.spec.arguments import ResolvedService
from dodo_dsl.spec.deployment.deployment import FILE_NAME, Deployment
from dodo_dsl.spec.manifest import Manifest, Parameter, load_manifests
from dodo_dsl.spec.model import LAYERS

WITH, USES = "with", "uses"


@dataclass(frozen=True)
class DocumentContext:
    """``root`` is the document as far as its text can be parsed; ``test`` is what the last check made of it."""

    path: Path
    lines: Lines
    root: Node | None
    manifests: Mapping[str, Manifest]
    deployment: Deployment | None = None
    test: ResolvedTest | None = None

    @property
    def schema(self) -> str:
        return "deployment" if self.path.name == FILE_NAME else "dodo"

    def service(self, layer: str, name: str) -> ResolvedService | None:
        """A service of the test as it was resolved last."""
        services = self.test.services if self.test else ()
        return next((s for s in services if (s.use.layer, s.use.name) == (layer, name)), None)

    def manifest(self, steps: Steps, uses: str = "") -> Manifest | None:
        """The manifest of the service that a place belongs to, which an extended test may name."""
        if len(steps) < 2 or steps[0] not in LAYERS or self.schema != "dodo":
            return None
        layer, name = str(steps[0]), str(steps[1])
        written = uses or text_of(below(self.root, layer, name, USES))
        if not written and (service := self.service(layer, name)):
            return service.manifest
        return self.manifests.get(written)

    def parameter(self, place: DocumentPlace) -> Parameter | None:
        """The parameter that a place belongs to."""
        manifest = self.manifest(place.steps)
        if manifest is None or len(place.steps) < 4 or place.steps[2] != WITH:
            return None
        return manifest.parameters.get(str(place.steps[3]))


def scene(path: Path, lines: Lines, projects: Sequence[Project]) -> DocumentContext:
    """A document with what was found about its test when it was checked last."""
    root, _ = parse_text(lines.text, path)
    for project in projects:
        checked = project.checked
        test = next((test for test in checked.tests if test.spec.path == path), None)
        if test or checked.deployment.file == path:
            return DocumentContext(path, lines, root, checked.manifests, checked.deployment, test)
    return DocumentContext(path, lines, root, load_manifests()[0])
