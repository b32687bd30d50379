"""The deployment: ``dodo.yml`` at the root of a user's repository."""

import ipaddress
from dataclasses import dataclass
from pathlib import Path

from dodo_dsl import __version__, data
from dodo_dsl.diagnostics import Diagnostic, has_errors
from dodo_dsl.source import Entry, Mapping, Scalar, plain, read
from dodo_dsl.spec.schema import validate

FILE_NAME = "dodo.yml"
SHIPPED = "dodo:"
RESERVED_CIDS = frozenset({111, 112})
DEFAULT_SUBNETS = ipaddress.IPv4Network("10.213.0.0/16")


@dataclass(frozen=True)
class Deployment:
    """Where tests and application are; ``root`` is the folder of ``dodo.yml``, or the working folder without one."""

    root: Path
    file: Path | None = None
    registry: tuple[Path, ...] = ()
    application: Path | None = None
    image_prefix: str = "dodo"
    image_tag: str = __version__
    cids: tuple[int, ...] = tuple(range(128, 255))
    subnets: ipaddress.IPv4Network = DEFAULT_SUBNETS
    gates: bool = True


def find_deployment(start: Path) -> Path | None:
    """The nearest ``dodo.yml`` at or above a folder."""
    folder = start.resolve()
    for candidate in (folder, *folder.parents):
        if (candidate / FILE_NAME).is_file():
            return candidate / FILE_NAME
    return None


def load_deployment(path: Path | None) -> tuple[Deployment, list[Diagnostic]]:
    """The deployment of a ``dodo.yml``; without one, the shipped registry and no application."""
    if path is None:
        return Deployment(Path.cwd(), registry=(data.registry(),)), []
    node, found = read(path)
    if node is not None:
        found = [*found, *validate(node, "deployment")]
    fallback = Deployment(path.parent, path, registry=(data.registry(),))
    if not isinstance(node, Mapping) or has_errors(found):
        return fallback, found
    raw = plain(node)
    images = raw.get("images", {})
    problems: list[Diagnostic] = []
    deployment = Deployment(
        root=path.parent,
        file=path,
        registry=_registry(path.parent, node.entries.get("registry"), problems),
        application=_application(path.parent, node.entries.get("application"), problems),
        image_prefix=images.get("prefix", "dodo"),
        image_tag=images.get("tag", __version__),
        cids=_cids(node.entries.get("cids"), problems),
        subnets=_subnets(node.entries.get("subnets"), problems),
        gates=raw.get("gates", True),
    )
    return deployment, [*found, *problems]


def _registry(root: Path, entry: Entry | None, problems: list[Diagnostic]) -> tuple[Path, ...]:
    if entry is None:
        return (data.registry(),)
    folders = []
    for item in getattr(entry.value, "items", ()):
        folder = data.registry() if item.text == SHIPPED else (root / item.text).resolve()
        if not folder.is_dir():
            problems.append(Diagnostic(item.span, "missing-file", f"there is no folder '{item.text}'"))
        folders.append(folder)
    return tuple(folders)


def _application(root: Path, entry: Entry | None, problems: list[Diagnostic]) -> Path | None:
    if entry is None or not isinstance(entry.value, Scalar):
        return None
    path = root / entry.value.text
    if not path.is_file():
        problems.append(Diagnostic(entry.value.span, "missing-file", f"there is no file '{entry.value.text}'"))
        return None
    return path


def _cids(entry: Entry | None, problems: list[Diagnostic]) -> tuple[int, ...]:
    if entry is None or not isinstance(entry.value, Scalar):
        return Deployment.cids
    low, high = (int(part) for part in entry.value.text.split("-"))
    if not 1 <= low <= high <= 254:
        message = f"'{entry.value.text}' is no range of CIDs, expected numbers from 1 to 254, the lower one first"
        problems.append(Diagnostic(entry.value.span, "out-of-range", message))
        return Deployment.cids
    return tuple(cid for cid in range(low, high + 1) if cid not in RESERVED_CIDS)


def _subnets(entry: Entry | None, problems: list[Diagnostic]) -> ipaddress.IPv4Network:
    if entry is None or not isinstance(entry.value, Scalar):
        return DEFAULT_SUBNETS
    try:
        network = ipaddress.IPv4Network(entry.value.text)
    except ValueError as error:
        problems.append(Diagnostic(entry.value.span, "wrong-value", f"no IPv4 network: {error}"))
        return DEFAULT_SUBNETS
    if network.prefixlen > 28:
        message = f"'{entry.value.text}' is too small, every test needs a /28"
        problems.append(Diagnostic(entry.value.span, "out-of-range", message))
        return DEFAULT_SUBNETS
    return network
