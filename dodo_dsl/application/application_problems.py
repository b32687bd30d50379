"""Problems of an application as a whole: missing files, dependency cycles, and no service that takes a CID."""

from collections.abc import Iterator, Mapping
from typing import Any

from dodo_dsl import source
from dodo_dsl.application import opendlv_flags
from dodo_dsl.application.access.access_diagnostics import place
from dodo_dsl.application.compose_paths import is_local
from dodo_dsl.application.host_access import is_true, references
from dodo_dsl.application.model import ApplicationSource, ComposeService, environment, plain, text
from dodo_dsl.application.mounted_folders import missing_folders
from dodo_dsl.application.nested_mounts import nested_mounts
from dodo_dsl.application.service_environment import image_variable
from dodo_dsl.application.service_problems import Written, problems
from dodo_dsl.application.slips import cid_slips, missing_program
from dodo_dsl.diagnostics import Diagnostic, Span, has_errors


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
        found.extend(_missing_folder(service, application))
        found.extend(missing_program(service, application.folder))
    found.extend(nested_mounts(application))
    found.extend(missing_folders(application))
    found.extend(_cycles(application))
    found.extend(_never_healthy(application))
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


def _missing_folder(service: ComposeService, application: ApplicationSource) -> Iterator[Diagnostic]:
    """A folder to build from that is not there: a warning, as an image or a variable for it may stand in."""
    build = service.node.get("build")
    context = build.get("context") if isinstance(build, source.Mapping) else build
    if not isinstance(context, source.Scalar) or not isinstance(context.value, str) or not is_local(context.value):
        return
    if application.paths.is_own(context.value) and not (application.folder / context.value).is_dir():
        hint = "create it, or remove 'build'; paths are relative to this file"
        yield Diagnostic(context.span, "application-file", f"there is no folder '{context.text}'", hint, "warning")


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


def _never_healthy(application: ApplicationSource) -> Iterator[Diagnostic]:
    """Services that wait for the health of one whose health check is turned off; an image may have one as well."""
    for service in application.services.values():
        needed = plain(service.node).get("depends_on")
        for name, about in needed.items() if isinstance(needed, dict) else ():
            other = application.services.get(str(name))
            is_waiting = isinstance(about, dict) and about.get("condition") == "service_healthy"
            check = plain(other.node).get("healthcheck") if other and is_waiting else None
            if isinstance(check, dict) and (
                is_true(check.get("disable") or False) or check.get("test") in ("NONE", ["NONE"])
            ):
                message = f"'{service.name}' waits for '{name}' to be healthy, whose health check is turned off"
                hint = f"give '{name}' a healthcheck, or wait with 'condition: service_started'"
                span = place(service.node, ("depends_on", str(name), "condition"), service.span)
                yield Diagnostic(span, "application-file", message, hint)


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
    """Warnings of flags that give no CID, of services with messages that take none, and of none that does."""
    services = application.services.values()
    slips = {service.name: list(cid_slips(service, _takes_cid(service))) for service in services}
    yield from (slip for found in slips.values() for slip in found)
    without = [service for service in services if not slips[service.name] and not _takes_cid(service)]
    if len(without) == len(services):
        message = "no service takes a CID (--cid=, CID or OD4SESSION_CID), so every test runs with the built-in one"
        yield Diagnostic(without[0].span, "application-cid", message, "add --cid=111 to its command", "warning")
        return
    for service in without:
        if service.declared and (service.declared.inputs or service.declared.outputs):
            message = f"'{service.name}' has messages, but takes no CID (--cid=, CID or OD4SESSION_CID)"
            yield Diagnostic(service.span, "application-cid", message, "add --cid=111 to its command", "warning")


def _takes_cid(service: ComposeService) -> bool:
    raw = plain(service.node)
    variables = environment(raw.get("environment"))
    words = [*_words(raw.get("entrypoint")), *_words(raw.get("command")), *(v for v in variables.values() if v)]
    return opendlv_flags.takes_cid(words, {**variables, **dict.fromkeys(service.cid_variables)})


def _words(command: Any) -> list[str]:
    return [command] if isinstance(command, str) else [text(word) for word in command or ()]
