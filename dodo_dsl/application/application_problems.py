"""Problems of an application as a whole: missing files, dependency cycles, and no service that takes a CID."""

import os
import shlex
import shutil
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, TypeGuard

from dodo_dsl import source
from dodo_dsl.application import opendlv_flags
from dodo_dsl.application.host_access import references
from dodo_dsl.application.model import ApplicationSource, ComposeService, environment, plain, text
from dodo_dsl.application.service_environment import image_variable
from dodo_dsl.application.service_problems import Written, problems
from dodo_dsl.diagnostics import Diagnostic, Span, closest, did_you_mean, has_errors

INTERPRETERS = ("python", "python3", "sh", "bash", "node", "perl", "ruby")


def application_problems(application: ApplicationSource, first: Span) -> Iterator[Diagnostic]:
    """Everything wrong with the services and their references; ``first`` is the place of the first service written."""
    if not application.services:
        message = "no service starts, because each one has a profile or is scaled to 0"
        yield Diagnostic(first, "application-file", message, "remove 'profiles' from one service")
        return
    volumes = plain(application.rest["volumes"]) if "volumes" in application.rest else {}
    found: list[Diagnostic] = []
    for service in application.services.values():
        found.extend(problems(Written.of(service, application, volumes or {})))
        found.extend(_missing_files(service, application))
        found.extend(_missing_program(service, application.folder))
    found.extend(_cycles(application))
    found.extend(_same_variable(application))
    yield from found
    if not has_errors(found):
        yield from _without_cid(application)


def _missing_files(service: ComposeService, application: ApplicationSource) -> Iterator[Diagnostic]:
    for file in service.env_files:
        is_local = "$" not in file.path and application.paths.is_own(file.path)
        if file.required and is_local and not (application.folder / file.path).is_file():
            hint = "create it, or write {path: ..., required: false}; paths are relative to this file"
            yield Diagnostic(file.span, "application-file", f"there is no file '{file.path}'", hint)


def _missing_program(service: ComposeService, folder: Path) -> Iterator[Diagnostic]:
    """What of ``x-dodo-process`` cannot start; programs may be built later, or be in the PATH of another machine."""
    process = service.node.get("x-dodo-process")
    words = [word for word in process.items if isinstance(word, source.Scalar)] if _is_list(process) else []
    if not words or "$" in words[0].text:
        return
    program = words[0]
    if program.text in INTERPRETERS:
        if len(words) > 1:
            yield from _missing_script(program.text, words[1], folder)
        return
    own = folder / program.text
    if "/" not in program.text:
        near = [] if shutil.which(program.text) else closest(program.text, INTERPRETERS)
        if near:
            yield _cannot_start(program, f"there is no program '{program.text}'", f"did you mean '{near[0]}'?")
    elif own.is_file() and not os.access(own, os.X_OK):
        yield _cannot_start(
            program, f"'{program.text}' is not executable", f"run: chmod +x {shlex.quote(program.text)}"
        )
    elif not own.exists() and own.parent.is_dir():
        near = closest(own.name, [path.name for path in own.parent.iterdir() if os.access(path, os.X_OK)])
        if near:
            meant = program.text.removesuffix(own.name) + near[0]
            yield _cannot_start(program, f"there is no program '{program.text}'", f"did you mean '{meant}'?")


def _is_list(node: source.Node | None) -> TypeGuard[source.Sequence]:
    return isinstance(node, source.Sequence)


def _cannot_start(word: source.Scalar, message: str, hint: str) -> Diagnostic:
    return Diagnostic(word.span, "application-file", message, hint, "warning")


def _missing_script(interpreter: str, script: source.Scalar, folder: Path) -> Iterator[Diagnostic]:
    name = script.text
    if name and not name.startswith("-") and "$" not in name and not (folder / name).is_file():
        beside = [path.name for path in folder.iterdir() if path.suffix == Path(name).suffix]
        hint = did_you_mean(Path(name).name, beside) or "without it the application starts in containers only"
        yield _cannot_start(script, f"there is no file '{name}' for {interpreter} to run", hint)


def _cycles(application: ApplicationSource) -> Iterator[Diagnostic]:
    """Services that depend on themselves, directly or through others."""
    containers = dict(application.containers)
    needs = {
        name: {other for _, other in references(plain(s.node), containers) if other in application.services}
        for name, s in application.services.items()
    }
    waiting = set(_never_ready(needs))
    wanted_by: dict[str, set[str]] = {name: set() for name in needs}
    for name in waiting:
        for other in needs[name]:
            wanted_by[other].add(name)
    cycle = [name for name in _never_ready(wanted_by) if name in waiting]
    if cycle:
        message = f"services depend on one another: {', '.join(cycle[:6])}{', ...' if len(cycle) > 6 else ''}"
        hint = "remove one of the dependencies, so that one service can start first"
        yield Diagnostic(application.services[cycle[0]].span, "application-file", message, hint)


def _never_ready(needs: Mapping[str, set[str]]) -> Iterator[str]:
    """Those that depend on themselves, or on such a service."""
    left = {name: len(others) for name, others in needs.items()}
    wanted_by: dict[str, list[str]] = {}
    for name, others in needs.items():
        for other in others:
            wanted_by.setdefault(other, []).append(name)
    ready = [name for name, count in left.items() if not count]
    while ready:
        for name in wanted_by.get(ready.pop(), ()):
            left[name] -= 1
            if not left[name]:
                ready.append(name)
    yield from (name for name, count in left.items() if count)


def _same_variable(application: ApplicationSource) -> Iterator[Diagnostic]:
    seen: dict[str, str] = {}
    for name in application.services:
        other = seen.setdefault(image_variable(name), name)
        if other != name:
            message = f"'{name}' and '{other}' would both take their image from {image_variable(name)}"
            yield Diagnostic(application.services[name].span, "application-file", message, "rename one of them")


def _without_cid(application: ApplicationSource) -> Iterator[Diagnostic]:
    """A warning when no service takes a CID."""
    if any(map(_takes_cid, application.services.values())):
        return
    first = next(iter(application.services.values())).span
    message = "no service takes a CID (--cid=, CID or OD4SESSION_CID), so every test runs with the built-in one"
    yield Diagnostic(first, "application-cid", message, "add --cid=111 to its command", "warning")


def _takes_cid(service: ComposeService) -> bool:
    raw = plain(service.node)
    variables = environment(raw.get("environment"))
    words = [*_words(raw.get("entrypoint")), *_words(raw.get("command")), *(v for v in variables.values() if v)]
    return opendlv_flags.takes_cid(words, {**variables, **dict.fromkeys(service.cid_variables)})


def _words(command: Any) -> list[str]:
    return [command] if isinstance(command, str) else [text(word) for word in command or ()]
