"""What an image holds of ``services``, beside what all share."""

from dodo_dsl.spec.manifest import Manifest

SCENE = "scene"


def folders_of(manifest: Manifest) -> list[str]:
    """The service's own folder, and before it the scene where it imports that."""
    sources = (path.read_text() for path in manifest.folder.rglob("*.py"))
    return [*([SCENE] if any(f"services.{SCENE}" in source for source in sources) else []), manifest.folder.name]
