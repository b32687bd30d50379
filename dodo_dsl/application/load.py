"""All files of an application merged into one document, with what they extend and include.

``docker compose`` also reads files that it finds next to those that DoDo was given: a warning names them.
"""

import os
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from dodo_dsl import source
from dodo_dsl.application import compose_merge, compose_paths
from dodo_dsl.application.compose_files import ComposeFiles, statements_of
from dodo_dsl.application.model import scalars
from dodo_dsl.diagnostics import Diagnostic, Span, did_you_mean, listed
from dodo_dsl.source import Entry, Node, Scalar

MAX_DEPTH = 8
"""Services that may extend one another in a chain."""
_NAMED = ("volumes", "secrets", "configs", "networks")


def load(files: ComposeFiles, names: Sequence[Path]) -> source.Mapping | None:
    """The files merged in order, with paths relative to the first one's folder; None when one cannot be read."""
    folder = names[0].parent
    taken = [word for name in names for word in _variables_of_secrets(files, name)]
    files.known |= files.gather(folder / ".env", taken)
    return _all(files, names, folder, ())


def _variables_of_secrets(files: ComposeFiles, file: Path) -> Iterator[str]:
    """The variables of which a file makes secrets, before it is read."""
    document = files.read(file)
    node = document.get("secrets") if isinstance(document, source.Mapping) else None
    for entry in node.entries.values() if isinstance(node, source.Mapping) else ():
        word = entry.value.get("environment") if isinstance(entry.value, source.Mapping) else None
        if isinstance(word, Scalar):
            yield word.text


def _all(files: ComposeFiles, names: Sequence[Path], folder: Path, chain: tuple[Path, ...]) -> source.Mapping | None:
    documents = [_whole(files, name, folder, chain) for name in names]
    result: Node | None = None
    for document in documents:
        if document is None:
            return None
        result = document if result is None else compose_merge.merged(result, document)
    settled = compose_merge.settled(result) if result is not None else None
    return settled if isinstance(settled, source.Mapping) else None


def _whole(files: ComposeFiles, file: Path, folder: Path, chain: tuple[Path, ...]) -> source.Mapping | None:
    """A file with what it extends and includes."""
    document = files.document(file)
    if document is None:
        return None
    rest = source.Mapping(document.span, {k: e for k, e in document.entries.items() if k != "include"})
    services = document.get("services")
    if isinstance(services, source.Mapping):
        entries = {
            name: Entry(entry.key, extended(files, ExtendedService(file, folder, name), entry.value))
            for name, entry in services.entries.items()
        }
        rest = _with(rest, "services", source.Mapping(services.span, entries, services.tag))
    include = document.get("include")
    for item in include.items if isinstance(include, source.Sequence) else (include,) if include else ():
        rest = _included(files, rest, item, folder, (*chain, file))
    return rest


def _included(
    files: ComposeFiles, document: source.Mapping, item: Node, folder: Path, chain: tuple[Path, ...]
) -> source.Mapping:
    """The document with what an item of ``include`` brings; paths relative to ``folder``."""
    words: Mapping[str, Node] = {"path": item}
    if isinstance(item, source.Mapping):
        words = {key: entry.value for key, entry in item.entries.items()}
    names = scalars(words.get("path"))
    if not names:
        files.problem(item.span, "'include' does not name a file", "for example include: [sensors.yml]")
        return document
    found = [file for name in names if (file := files.other(name, folder))]
    circle = next((name for name, file in zip(names, found, strict=False) if file in chain), None)
    if circle:
        files.problem(circle.span, f"'{circle.text}' includes itself, directly or through other files")
    if circle or len(found) < len(names):
        return document
    place = words.get("project_directory")
    if isinstance(place, Scalar) and not files.holds(place, folder):
        return document
    project = Path(os.path.normpath(folder / place.text)) if isinstance(place, Scalar) else found[0].parent
    own = [files.other(word, folder) for word in scalars(words.get("env_file"))] or [project / ".env"]
    before = files.included
    taken = [word for name in found for word in _variables_of_secrets(files, name)]
    files.included = {**before, **{k: v for file in own if file for k, v in files.gather(file, taken).items()}}
    part = _all(files, found, project, chain)
    files.included = before
    return document if part is None else _joined(files, document, part, project, folder)


def _joined(
    files: ComposeFiles, document: source.Mapping, part: source.Mapping, project: Path, folder: Path
) -> source.Mapping:
    base = compose_paths.escaped(Path(os.path.relpath(project, folder)).as_posix())
    named = {key: entry.value for key, entry in part.entries.items() if key in _NAMED}
    for key, node in compose_paths.mapped_rest(named, lambda path: compose_paths.rebased(path, base)).items():
        mine = document.get(key)
        document = _with(document, key, compose_merge.merged(node, mine) if mine else node)
    services, own = part.get("services"), document.get("services")
    theirs = services.entries if isinstance(services, source.Mapping) else {}
    ours = own.entries if isinstance(own, source.Mapping) else {}
    for name in sorted(set(ours) & set(theirs)):
        included = Path(theirs[name].key.file).name
        files.problem(ours[name].key, f"the included '{included}' also has a service '{name}'", "rename one of them")
    joined = {name: Entry(e.key, moved(e.value, project, folder)) for name, e in theirs.items()}
    return _with(document, "services", source.Mapping(document.span, {**joined, **ours}))


def _with(document: source.Mapping, key: str, node: Node) -> source.Mapping:
    place = document.entries[key].key if key in document.entries else node.span
    return source.Mapping(document.span, {**document.entries, key: Entry(place, node)}, document.tag)


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
        files.problem(word.span, f"unknown service '{base.name}' to extend", did_you_mean(base.name, entries))
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


_NAMES = ("compose.yaml", "compose.yml", "docker-compose.yml", "docker-compose.yaml")
_OVERRIDES = (
    "compose.override.yml",
    "compose.override.yaml",
    "docker-compose.override.yml",
    "docker-compose.override.yaml",
)
"""Of each, compose takes the first that is there."""
_LIST, _SEPARATOR = "COMPOSE_FILE", "COMPOSE_PATH_SEPARATOR"
_PLAIN = re.compile(r"[\w./-]+")


def unread(paths: Sequence[Path], root: Path | None = None) -> Iterator[Diagnostic]:
    """A warning if compose would read other files together with one of ``paths``.

    Its hint names files as ``dodo.yml`` does, which is in ``root`` or else next to them.
    """
    folder = paths[0].parent
    named = [_whole_file(path) for path in paths]
    found, why = _discovered(folder)
    others = [path for path in found if path not in named]
    if not others or len(others) == len(found):
        return
    names = listed([f"'{os.path.relpath(path, folder)}'" for path in others])
    items = [as_item(path, root or folder) for path in [*found, *(path for path in named if path not in found)]]
    own = as_item(next(path for path in named if path in found), folder)
    yield Diagnostic(
        Span(str(paths[0])),
        "application-override",
        f"'docker compose' also reads {names}, {why}; DoDo does not",
        f"write application: [{', '.join(items)}] in dodo.yml; to test without it, name another file there that has "
        f"include: [{own}]",
        "warning",
    )


def _discovered(folder: Path) -> tuple[list[Path], str]:
    """The files that compose reads in a folder, in its order, and why it reads the later ones."""
    variables = dict(statements_of(folder / ".env"))
    if text := variables.get(_LIST):
        names = text.split(variables.get(_SEPARATOR) or os.pathsep)
        return [_whole_file(folder / name) for name in names if name], f"as {_LIST} in .env says"
    there = [
        [_whole_file(folder / name) for name in names if (folder / name).is_file()] for names in (_NAMES, _OVERRIDES)
    ]
    return [paths[0] for paths in there if paths], "which it finds next to this file"


def _whole_file(path: Path) -> Path:
    return Path(os.path.normpath(path.absolute()))


def as_item(path: Path, folder: Path) -> str:
    """A path as an item of a list in YAML."""
    text = os.path.relpath(path, _whole_file(folder))
    return text if _PLAIN.fullmatch(text) else f'"{text}"'
