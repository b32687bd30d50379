"""``extends``: a service merged over another one, of the same file or of another."""

import os
from dataclasses import dataclass
from pathlib import Path

from dodo_dsl import source
from dodo_dsl.application import compose_merge, compose_paths
from dodo_dsl.application.compose_files import ComposeFiles
from dodo_dsl.diagnostics import did_you_mean
from dodo_dsl.source import Entry, Node, Scalar

MAX_DEPTH = 8


@dataclass(frozen=True)
class ExtendedService:
    """A service in a file; the file's paths are relative to ``folder``."""

    file: Path
    folder: Path
    name: str


def extended(
    files: ComposeFiles, service: ExtendedService, node: Node, chain: tuple[ExtendedService, ...] = ()
) -> Node:
    """The service merged over what it extends."""
    if not isinstance(node, source.Mapping) or "extends" not in node.entries or files.full:
        return node
    own = source.Mapping(node.span, {k: e for k, e in node.entries.items() if k != "extends"}, node.tag)
    base = _base(files, node.entries["extends"], (*chain, service))
    result = own if base is None else compose_merge.merged_service(base, own)
    files.grow(result, node.entries["extends"].key)
    return result


def _base(files: ComposeFiles, entry: Entry, chain: tuple[ExtendedService, ...]) -> Node | None:
    words = entry.value.entries if isinstance(entry.value, source.Mapping) else {"service": entry}
    word, where = (words[key].value if key in words else None for key in ("service", "file"))
    if not isinstance(word, Scalar) or not (where is None or isinstance(where, Scalar)):
        files.problem(
            entry.key, "'extends' does not name a service", "for example extends: {file: common.yml, service: base}"
        )
        return None
    file = files.other(where, chain[-1].folder) if where else chain[-1].file
    document = files.document(file) if file else None
    if file is None or document is None:
        return None
    base = ExtendedService(file, file.parent if where else chain[-1].folder, word.text)
    return _found(files, document, base, word, chain)


def _found(
    files: ComposeFiles,
    document: source.Mapping,
    base: ExtendedService,
    word: Scalar,
    chain: tuple[ExtendedService, ...],
) -> Node | None:
    services = document.get("services")
    entries = services.entries if isinstance(services, source.Mapping) else {}
    if base.name not in entries:
        files.problem(word.span, f"there is no service '{base.name}' to extend", did_you_mean(base.name, entries))
        return None
    if base in chain or len(chain) > MAX_DEPTH:
        names = " extends ".join(f"'{service.name}'" for service in (*chain, base))
        long = f"the chain of services that '{chain[0].name}' extends is longer than {MAX_DEPTH}"
        files.problem(word.span, f"a service extends itself: {names}" if base in chain else long)
        return None
    node = compose_merge.settled(extended(files, base, entries[base.name].value, chain))
    return moved(node, base.folder, chain[-1].folder)


def moved(service: Node, folder: Path, to: Path) -> Node:
    """A service of one folder with its paths as seen from another."""
    if not isinstance(service, source.Mapping) or folder == to:
        return service
    base = compose_paths.escaped(Path(os.path.relpath(folder, to)).as_posix())
    return compose_paths.mapped_service(service, lambda path: compose_paths.rebased(path, base))
