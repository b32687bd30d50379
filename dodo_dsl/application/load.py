"""All files of an application merged into one document, with what they extend and include."""

import functools
import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from dodo_dsl import source
from dodo_dsl.application import merge
from dodo_dsl.application.compose_files import ComposeFiles
from dodo_dsl.application.model import scalars, with_entry
from dodo_dsl.diagnostics import Diagnostic, Span, did_you_mean
from dodo_dsl.source import Entry, Node, Scalar

MAX_DEPTH = 8
"""Services that may extend one another in a chain."""
_NAMED = ("services", "volumes", "secrets", "configs", "networks")


def load(files: ComposeFiles, names: Sequence[Path]) -> source.Mapping | None:
    """The files merged in order, with paths relative to the first one's folder; None when one cannot be read."""
    taken = [word for name in names for word in _variables_of_secrets(files, name)]
    files.known |= files.gather(files.folder / ".env", taken)
    return _all(files, names, files.folder, ())


def _variables_of_secrets(files: ComposeFiles, file: Path) -> Iterator[str]:
    """The variables of which a file makes secrets, before it is read."""
    for entry in source.entries(files.read(file), "secrets").values():
        word = source.part(entry.value, "environment")
        if isinstance(word, Scalar):
            yield word.text


def _all(files: ComposeFiles, names: Sequence[Path], folder: Path, chain: tuple[Path, ...]) -> source.Mapping | None:
    documents = [_whole(files, name, folder, chain) for name in names]
    whole: list[Node] = [document for document in documents if document is not None]
    if len(whole) < len(documents):
        return None
    settled = merge.settled(functools.reduce(merge.merged, whole))
    assert isinstance(settled, source.Mapping)
    here = files.relative(folder)
    return _without_bound(_changed(settled, lambda _, service: _with_context(service, here)))


def _without_bound(document: source.Mapping) -> source.Mapping:
    """A file with mounts of folders in place of volumes that bind them (``driver_opts: {o: bind, device: ./data}``)."""
    volumes, bound = source.entries(document, "volumes"), dict[str, tuple[Scalar, bool]]()
    for name, entry in volumes.items():
        words, device = (source.part(entry.value, "driver_opts", key) for key in ("o", "device"))
        if isinstance(words, Scalar) and isinstance(device, Scalar) and merge.is_path(device.text):
            options = words.text.split(",")
            bound |= {name: (device, "ro" in options)} if "bind" in options else {}

    def mounting(_: str, service: Node) -> Node:
        node = source.part(service, "volumes")
        if not isinstance(service, source.Mapping) or not isinstance(node, source.Sequence):
            return service
        return with_entry(service, "volumes", replace(node, items=tuple(map(mounted, node.items))))

    def mounted(item: Node) -> Node:
        name = source.part(item, "source")
        if not isinstance(item, source.Mapping) or not isinstance(name, Scalar) or name.text not in bound:
            return item
        device, is_read = bound[name.text]
        item = with_entry(item, "type", Scalar(name.span, "bind", "bind"))
        item = with_entry(item, "source", Scalar(name.span, device.value, device.text))
        return with_entry(item, "read_only", Scalar(name.span, True, "true")) if is_read else item

    kept = {name: entry for name, entry in volumes.items() if name not in bound}
    whole = with_entry(document, "volumes", source.Mapping(document.span, kept))
    return _changed(whole, mounting) if bound else document


def _changed(document: source.Mapping, change: Callable[[str, Node], Node]) -> source.Mapping:
    services = document.get("services")
    if not isinstance(services, source.Mapping):
        return document
    entries = {name: Entry(entry.key, change(name, entry.value)) for name, entry in services.entries.items()}
    return with_entry(document, "services", source.Mapping(services.span, entries, services.tag))


def _with_context(service: Node, here: str) -> Node:
    """A service whose build has the folder that compose takes without one."""
    build = source.part(service, "build")
    if not isinstance(service, source.Mapping) or not isinstance(build, source.Mapping) or "context" in build.entries:
        return service
    return with_entry(service, "build", with_entry(build, "context", Scalar(service.entries["build"].key, here, here)))


def _whole(files: ComposeFiles, file: Path, folder: Path, chain: tuple[Path, ...]) -> source.Mapping | None:
    document = files.document(file, folder)
    if document is None:
        return None
    rest = source.Mapping(document.span, {k: e for k, e in document.entries.items() if k != "include"})
    rest = _changed(rest, lambda name, service: _extended(files, (Service(file, folder, name),), service))
    include = document.get("include")
    for item in include.items if isinstance(include, source.Sequence) else (include,) if include else ():
        part = _included(files, item, folder, (*chain, file))
        rest = _joined(files, rest, part) if part else rest
    return rest


def _included(files: ComposeFiles, item: Node, folder: Path, chain: tuple[Path, ...]) -> source.Mapping | None:
    names = scalars(source.part(item, "path") if isinstance(item, source.Mapping) else item)
    if not names:
        files.problem(item.span, "'include' does not name a file", "for example include: [sensors.yml]")
    found = [file for name in names if (file := files.other(name, folder))]
    circle = next((name for name, file in zip(names, found, strict=False) if file in chain), None)
    if circle:
        files.problem(circle.span, f"'{circle.text}' includes itself, directly or through other files")
    place = source.part(item, "project_directory")
    if not names or circle or len(found) < len(names) or (isinstance(place, Scalar) and not files.holds(place, folder)):
        return None
    project = Path(os.path.normpath(folder / place.text)) if isinstance(place, Scalar) else found[0].parent
    own = [files.other(word, folder) for word in scalars(source.part(item, "env_file"))] or [project / ".env"]
    taken = [word for name in found for word in _variables_of_secrets(files, name)]
    files.known = {**{k: v for file in own if file for k, v in files.gather(file, taken).items()}, **files.known}
    return _all(files, found, project, chain)


def _joined(files: ComposeFiles, document: source.Mapping, part: source.Mapping) -> source.Mapping:
    """A file with what another one brings, of which it changes everything but services."""
    theirs = source.entries(part, "services")
    for name, entry in source.entries(document, "services").items():
        if name in theirs:
            included = Path(theirs[name].key.file).name
            files.problem(entry.key, f"the included '{included}' also has a service '{name}'", "rename one of them")
    kept = {key: entry for key, entry in part.entries.items() if key in _NAMED}
    merged = merge.merged(source.Mapping(document.span, kept), document)
    return merged if isinstance(merged, source.Mapping) else document


class Service(NamedTuple):
    """A service in a file whose paths are relative to ``folder``."""

    file: Path
    folder: Path
    name: str


def _extended(files: ComposeFiles, chain: tuple[Service, ...], node: Node) -> Node:
    if not isinstance(node, source.Mapping) or "extends" not in node.entries or files.full:
        return node
    own = source.Mapping(node.span, {k: e for k, e in node.entries.items() if k != "extends"}, node.tag)
    base = _base(files, node.entries["extends"], chain)
    result = own if base is None else merge.merged_service(base, own)
    files.grow(result, node.entries["extends"].key)
    return result


def _base(files: ComposeFiles, entry: Entry, chain: tuple[Service, ...]) -> Node | None:
    words = entry.value.entries if isinstance(entry.value, source.Mapping) else {"service": entry}
    word, where = (words[key].value if key in words else None for key in ("service", "file"))
    if not isinstance(word, Scalar) or not (where is None or isinstance(where, Scalar)):
        hint = "for example extends: {file: common.yml, service: base}"
        files.problem(entry.key, "'extends' does not name a service", hint)
        return None
    file = files.other(where, chain[-1].folder) if where else chain[-1].file
    if file is None:
        return None
    base = Service(file, file.parent if where else chain[-1].folder, word.text)
    document = files.document(file, base.folder)
    entries = source.entries(document, "services")
    if base.name in entries and base not in chain and len(chain) < MAX_DEPTH:
        return merge.settled(_extended(files, (*chain, base), entries[base.name].value))
    if base in chain or base.name in entries:
        names = " extends ".join(f"'{service.name}'" for service in (*chain, base))
        long = f"the chain of services that '{chain[0].name}' extends is longer than {MAX_DEPTH}"
        files.problem(word.span, f"a service extends itself: {names}" if base in chain else long)
    elif document:
        files.problem(word.span, f"unknown service '{base.name}' to extend", did_you_mean(base.name, entries))
    return None


def overrides(paths: Sequence[Path]) -> Iterator[Diagnostic]:
    first = paths[0]
    if len(paths) == 1 and first.name in _OVERRIDDEN:
        for found in sorted(first.parent.glob("*compose.override.y*ml"))[:1]:
            message = f"'docker compose' also reads '{found.name}', which it finds next to this file; DoDo does not"
            hint = f"name both files in dodo.yml: application: [{first.name}, {found.name}]; to test without it, name "
            hint += f"another file there that has include: [{first.name}]"
            yield Diagnostic(Span(str(first)), "application-override", message, hint, "warning")


_OVERRIDDEN = ("compose.yaml", "compose.yml", "docker-compose.yaml", "docker-compose.yml")
