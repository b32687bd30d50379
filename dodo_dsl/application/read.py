"""``read_application``: compose files as DoDo reads them, and their problems."""

import itertools
import os
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from dodo_dsl import source
from dodo_dsl.application import declarations as declared
from dodo_dsl.application import secret_problems
from dodo_dsl.application.application_problems import application_problems, unknown_keys
from dodo_dsl.application.compose_files import TEST_FILLED, ComposeFiles
from dodo_dsl.application.construction import Construction, Setting
from dodo_dsl.application.host_paths import INSIDE, link_out, repository
from dodo_dsl.application.load import as_item, load, unread
from dodo_dsl.application.merge import normal
from dodo_dsl.application.model import (
    Access,
    ApplicationSource,
    ComposeService,
    declared_cid,
    env_files,
    file_statements,
    plain,
)
from dodo_dsl.application.model import declared as declaration_of
from dodo_dsl.application.variables import tunable_problems, with_values
from dodo_dsl.diagnostics import Diagnostic, Span, has_errors
from dodo_dsl.source import Entry, Reader
from dodo_dsl.spec.deployment import Declarations
from dodo_dsl.spec.sandbox_limits import SandboxLimits
from dodo_dsl.spec.validation import validate

MAX_SERVICES = 256


def read_application(
    path: Path | Sequence[Path],
    access: Access = Access(),  # noqa: B008  (it is frozen)
    limits: SandboxLimits = SandboxLimits(),  # noqa: B008
    reader: Reader = source.read,
    declarations: Declarations = Declarations(),  # noqa: B008
) -> tuple[ApplicationSource | None, list[Diagnostic]]:
    """An application from one compose file, or from several that are merged in order, and its problems.

    ``access`` is what the deployment allows it, ``limits`` are the highest that it may set. ``declarations`` are what
    the deployment says of the application in its files; they do not hold for others. One with errors is as far as it
    could be read.
    """
    paths = [path] if isinstance(path, Path) else list(path)
    declarations = declared.holding(declarations, paths)
    roots = (*repository(paths[0].resolve().parent), *map(Path, access.roots))
    files = ComposeFiles(paths[0].parent, reader, roots, access.passed)
    found = files.problems
    found.extend(_links(paths))
    if found:
        return None, found
    document = load(files, paths)
    if document is None:
        return None, found
    found.extend(declared.problems(document, declarations))
    gone = declared.left_out(document, declarations)
    document = declared.declared_in(document, declarations)
    services = source.entries(document, "services")
    found.extend(itertools.chain.from_iterable(unknown_keys(entry.value) for entry in services.values()))
    if len(services) > MAX_SERVICES:
        message = f"the application has more than {MAX_SERVICES} services"
        found.append(Diagnostic(document.entries["services"].value.span, "too-large", message))
    if not any(p.rule != "unknown-key" for p in found if p.severity == "error"):
        found.extend(validate(document, "application"))
    if has_errors(found):
        return None, found
    root = Path(access.roots[0]) if access.roots else None
    dropped = {name: why for name, entry in services.items() if (why := _why_dropped(plain(entry.value)))}
    started = {name: entry for name, entry in services.items() if name not in dropped}
    named = {name: source.part(entry.value, "container_name") for name, entry in started.items()}
    containers = {node.text: name for name, node in named.items() if isinstance(node, source.Scalar)}
    folder = paths[0].resolve().parent
    kept = {name: _service(name, entry, files, folder, containers) for name, entry in started.items()}
    application = ApplicationSource(
        path=paths[0].resolve(),
        services=kept,
        dropped={**dropped, **gone},
        secrets=files.secrets,
        known={name: value for name, value in files.known.items() if name not in files.secrets},
        access=access,
        limits=limits,
        top=document.entries,
        named=tuple(as_item(path.resolve(), (root or paths[0].parent).resolve()) for path in paths),
        without=tuple(gone),
        cids=tuple(filter(None, map(declared_cid, [document, *(service.node for service in kept.values())]))),
    )
    found.extend(() if "COMPOSE_FILE" in files.known else unread(paths, root))
    construction = Construction(application, Setting(1, "network", application.folder, limits=limits))
    found.extend(application_problems(application, construction, next(iter(services.values())).key))
    application = replace(application, shown=tuple(construction.shown))
    found.extend(tunable_problems(application))
    refused = {problem.span for problem in found}
    nodes = [*(service.node for service in application.services.values()), *application.rest.values()]
    known = {*files.known, *files.secrets, *files.passed}
    secrets = secret_problems.withheld(nodes, files.written, known, os.environ)
    found.extend(problem for problem in secrets if problem.span not in refused)
    return (application if application.services else None), found


def as_written(path: Path) -> ApplicationSource | None:
    """The application of a compose file with whatever is wrong with it; None if it cannot be read."""
    return read_application(path)[0]


def _links(paths: Sequence[Path]) -> Iterator[Diagnostic]:
    """Files that symbolic links lead out of the repository in which they are named."""
    for path in paths:
        if out := link_out(path):
            message = f"the file is a symbolic link to '{out}', outside the repository"
            yield Diagnostic(Span(str(path)), "application-isolation", message, INSIDE)


def _service(name: str, entry: Entry, files: ComposeFiles, folder: Path, containers: dict[str, str]) -> ComposeService:
    assert isinstance(entry.value, source.Mapping)
    node = normal(entry.value, containers)
    raw = {key: node.entries[key].value for key in TEST_FILLED if key in node.entries}
    node = with_values(node, raw, files.known, files.is_late)
    own = tuple(env_files(node))
    return ComposeService(name, node, entry.key, declaration_of(node), own, file_statements(own, folder), raw)


def _why_dropped(service: dict[str, Any]) -> str:
    profiles = [str(p) for p in service.get("profiles") or ()]
    if profiles:
        return f"it needs profile {' or '.join(profiles)}"
    deploy = service.get("deploy") or {}
    counts = {str(service.get("scale")).strip(), str(deploy.get("replicas")).strip()}
    return "it is scaled to 0" if "0" in counts else ""
