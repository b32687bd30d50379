"""``read_application``: compose files as DoDo reads them, and their problems.

What ``dodo.yml`` says of an application counts as if its compose files said it, with problems at their place there:
``without``, and the keys of ``x-dodo``.
"""

import itertools
import os
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from dodo_dsl import source
from dodo_dsl.application import secret_variables
from dodo_dsl.application.application_problems import application_problems, unknown_keys
from dodo_dsl.application.compose_files import TEST_FILLED, ComposeFiles
from dodo_dsl.application.construction import Construction, Setting
from dodo_dsl.application.container import is_carried
from dodo_dsl.application.host_paths import INSIDE, link_out, repository
from dodo_dsl.application.interpolation import names
from dodo_dsl.application.load import load, overrides
from dodo_dsl.application.merge import joined
from dodo_dsl.application.model import (
    KEYS,
    Access,
    ApplicationSource,
    ComposeService,
    declared,
    declared_cid,
    env_files,
    plain,
    with_entry,
)
from dodo_dsl.application.ros_topics import BRIDGE, bridge
from dodo_dsl.application.variables import tunable_problems, with_values
from dodo_dsl.diagnostics import Diagnostic, Span, did_you_mean, has_errors
from dodo_dsl.source import Entry, Mapping, Node, Scalar, entries
from dodo_dsl.spec.deployment import Declarations
from dodo_dsl.spec.sandbox_limits import SandboxLimits
from dodo_dsl.spec.validation import validate

MAX_SERVICES = 256
PROCESS = "process"
"""The key in ``dodo.yml`` for ``x-dodo-process``."""
_DECLARED, _OF_PROCESS = KEYS
_OF_FOLDER = ("PWD", "PATH")
"""Variables that compose sets itself."""


def read_application(
    path: Path | Sequence[Path],
    access: Access = Access(),  # noqa: B008  (it is frozen)
    limits: SandboxLimits = SandboxLimits(),  # noqa: B008
    declarations: Declarations = Declarations(),  # noqa: B008
) -> tuple[ApplicationSource | None, list[Diagnostic]]:
    """An application from one compose file, or from several that are merged in order, and its problems.

    ``access`` is what the deployment allows it, ``limits`` are the highest that it may set. ``declarations`` are what
    the deployment says of the application in its files; they do not hold for others. One with errors is as far as it
    could be read.
    """
    paths = [path] if isinstance(path, Path) else list(path)
    folder = paths[0].resolve().parent
    files = ComposeFiles(paths[0].parent, (*repository(folder), *map(Path, access.roots)), access.passed)
    found = files.problems
    found.extend(_links(paths))
    document = None if found else load(files, paths)
    if document is None:
        return None, found
    if [file.resolve() for file in declarations.files] != [file.resolve() for file in paths]:
        declarations = Declarations()
    services = entries(document, "services")
    gone = {word.text: "dodo.yml leaves it out" for word in declarations.without if word.text in services}
    found.extend(_declaration_problems(services, declarations, gone))
    document = _declared_in(document, declarations, gone)
    services = entries(document, "services")
    found.extend(itertools.chain.from_iterable(unknown_keys(entry.value) for entry in services.values()))
    if len(services) > MAX_SERVICES:
        message = f"the application has more than {MAX_SERVICES} services"
        found.append(Diagnostic(document.entries["services"].value.span, "too-large", message))
    if not any(p.rule != "unknown-key" for p in found if p.severity == "error"):
        found.extend(validate(document, "application"))
    if has_errors(found):
        return None, found
    dropped = {name: why for name, entry in services.items() if (why := _why_dropped(plain(entry.value)))}
    started = {name: entry for name, entry in services.items() if name not in dropped}
    containers = {
        word.text: name
        for name, entry in started.items()
        if isinstance(word := source.part(entry.value, "container_name"), Scalar)
    }
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
        cids=tuple(filter(None, map(declared_cid, [document, *(service.node for service in kept.values())]))),
    )
    found.extend(() if "COMPOSE_FILE" in files.known else overrides(paths))
    construction = Construction(application, Setting(1, "network", application.folder, limits=limits))
    found.extend(application_problems(application, construction, next(iter(services.values())).key))
    found.extend(tunable_problems(application))
    found += _unknown_variables(application, files)
    if application.speaks_ros:
        node = bridge()
        raw = {"command": node.entries["command"].value}
        kept = {**kept, BRIDGE: ComposeService(BRIDGE, node, node.span, None, (), raw)}
    return (replace(application, services=kept, shown=tuple(construction.shown)) if kept else None), found


def as_written(path: Path) -> ApplicationSource | None:
    """The application of a compose file with whatever is wrong with it; None if it cannot be read."""
    return read_application(path)[0]


def _links(paths: Sequence[Path]) -> Iterator[Diagnostic]:
    for path in paths:
        if out := link_out(path):
            message = f"the file is a symbolic link to '{out}', outside the repository"
            yield Diagnostic(Span(str(path)), "application-isolation", message, INSIDE)


def _service(name: str, entry: Entry, files: ComposeFiles, folder: Path, containers: dict[str, str]) -> ComposeService:
    assert isinstance(entry.value, Mapping)
    node = joined(entry.value, containers)
    raw = {key: node.entries[key].value for key in TEST_FILLED if key in node.entries}
    node = with_values(node, raw, files.known, files.is_late)
    return ComposeService(name, node, entry.key, declared(node), tuple(env_files(node, folder)), raw)


def _why_dropped(service: dict[str, Any]) -> str:
    profiles = [str(p) for p in service.get("profiles") or ()]
    if profiles:
        return f"it needs profile {' or '.join(profiles)}"
    deploy = service.get("deploy") or {}
    counts = {str(service.get("scale")).strip(), str(deploy.get("replicas")).strip()}
    return "it is scaled to 0" if "0" in counts else ""


def _declared_in(document: Mapping, declarations: Declarations, gone: dict[str, str]) -> Mapping:
    """The merged compose files without what is left out, and with what ``dodo.yml`` says of the other services."""
    if declarations.own:
        about = next(iter(declarations.own.values()))
        document = with_entry(document, _DECLARED, _both(document.get(_DECLARED), declarations.own, about.key))
    if not gone and not declarations.services:
        return document
    said = declarations.services
    kept = {
        name: Entry(entry.key, _declared(entry.value, said[name])) if name in said else entry
        for name, entry in entries(document, "services").items()
        if name not in gone
    }
    return with_entry(document, "services", Mapping(document.entries["services"].value.span, kept))


def _declared(service: Node, about: Entry) -> Node:
    if not isinstance(service, Mapping) or not isinstance(about.value, Mapping):
        return service
    keys = {key: entry for key, entry in about.value.entries.items() if key != PROCESS}
    if keys:
        service = with_entry(service, _DECLARED, _both(service.get(_DECLARED), keys, about.key))
    if PROCESS not in about.value.entries:
        return service
    return replace(service, entries={**service.entries, _OF_PROCESS: about.value.entries[PROCESS]})


def _both(old: Node | None, new: dict[str, Entry], span: Span) -> Mapping:
    return Mapping(old.span if old else span, {**entries(old), **new})


def _declaration_problems(
    services: dict[str, Entry], declarations: Declarations, gone: dict[str, str]
) -> Iterator[Diagnostic]:
    named = [(word.text, word.span) for word in declarations.without]
    named += [(name, entry.key) for name, entry in declarations.services.items()]
    for name, span in named:
        if name not in services:
            hint = did_you_mean(name, services)
            yield Diagnostic(span, "application-file", f"the application has no service '{name}'", hint)
    if gone and gone.keys() == services.keys():
        message = "'without' leaves out every service of the application, so that a test has nothing to start"
        hint = "name a compose file that has the service of your program under 'files'"
        yield Diagnostic(declarations.without[0].span, "application-file", message, hint)
    for name, entry in declarations.services.items():
        if name in gone:
            message = f"'{name}' is declared, but {gone[name]}"
            yield Diagnostic(entry.key, "application-file", message, "remove one of them")


def _unknown_variables(application: ApplicationSource, files: ComposeFiles) -> Iterator[Diagnostic]:
    """Variables that a test does not get, though they are in DoDo's own environment, and others that are empty."""
    seen = {*files.known, *files.secrets, *files.passed, *_OF_FOLDER}
    services = (service.node.entries.items() for service in application.services.values())
    carried = [(key, e.value) for key, e in itertools.chain.from_iterable(services) if is_carried(key)]
    named = (_named(node, key, files.written) for key, node in (*carried, *application.rest.items()))
    for name, span in itertools.chain.from_iterable(named):
        is_secret = secret_variables.holds_secret(name, os.environ.get(name, ""))
        if name in seen or name.startswith("DODO_IMAGE_"):
            continue
        if is_secret or name in os.environ:
            why = "looks like a secret" if is_secret else "is of DoDo's own environment"
            message = f"variable '{name}' {why}, so it is unset in a test"
            hint = f"to pass it, write environment: [{name}] in dodo.yml"
            yield Diagnostic(span, "application-secret", message, hint, "warning")
        elif name in files.unset.get(span, ()):
            message = f"variable '{name}' has no value, so it is empty here"
            hint = f"set it in .env beside this file, or write a default: ${{{name}:-...}}"
            yield Diagnostic(span, "application-required", message, hint, "warning")
        else:
            continue
        seen.add(name)


def _named(node: Node, key: str, texts: dict[Span, str]) -> Iterator[tuple[str, Span]]:
    """The variables that a node takes from outside, each with its place; ``key`` is the node's own."""
    if isinstance(node, Mapping):
        for word, entry in node.entries.items():
            if key in ("environment", "args") and isinstance(entry.value, Scalar) and entry.value.value is None:
                yield word, entry.key
            if not word.startswith("x-"):
                yield from _named(entry.value, word, texts)
    elif isinstance(node, source.Sequence):
        for item in node.items:
            yield from _named(item, "", texts)
    else:
        yield from ((name, node.span) for name in sorted(names(texts.get(node.span, ""))))
        if key == "environment" and isinstance(node.value, str):
            yield node.text, node.span
