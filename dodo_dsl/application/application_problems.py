"""Problems of an application beside those of its keys, which are judged where its services are made."""

import difflib
from collections.abc import Collection, Iterator, Sequence
from graphlib import CycleError, TopologicalSorter

from dodo_dsl import source
from dodo_dsl.application import opendlv_flags, stack
from dodo_dsl.application.construction import Construction
from dodo_dsl.application.interpolation import filled, literal
from dodo_dsl.application.model import (
    COMMANDS,
    KEYS,
    SANDBOX,
    ApplicationSource,
    ComposeService,
    declared_cid,
    image_variable,
    plain,
    references,
    words_of,
)
from dodo_dsl.application.variables import variables_of
from dodo_dsl.diagnostics import Diagnostic, Severity, Span, did_you_mean, has_errors, shown_path
from dodo_dsl.source import Node

_HIGHEST = 254


def application_problems(
    application: ApplicationSource, construction: Construction, first: Span
) -> Iterator[Diagnostic]:
    """Everything wrong with the services and their references; ``first`` is the place of the first service written."""
    if not application.services:
        message = "no service starts, because each one has a profile or is scaled to 0"
        yield Diagnostic(first, "application-file", message, "remove 'profiles' from one service")
        return
    found: list[Diagnostic] = []
    of_stack = stack.parts(application)
    for name, service in application.services.items():
        container = construction.containers[name]
        container.made()
        own = [*_name(service), *container.problems]
        part = of_stack.get(name)
        found.extend([stack.problem(service, part, [*of_stack], has_errors(own))] if part else own)
    found.extend(construction.check())
    found.extend(_cycles(application))
    found.extend(_same_variable(application))
    found.extend(_several_cids(application, of_stack))
    yield from found
    if not has_errors(found):
        yield from _without_cid(application)


def _cycles(application: ApplicationSource) -> Iterator[Diagnostic]:
    services = application.services
    needs = {n: {other for _, other in references(plain(s.node)) if other in services} for n, s in services.items()}
    try:
        TopologicalSorter(needs).prepare()
    except CycleError as error:
        first, *others = (name for name in services if name in error.args[1])
        more = ", ..." if len(others) > 5 else ""
        message = f"services depend on one another: {', '.join([first, *others[:5]])}{more}"
        hint = "remove one of the dependencies, so that one service can start first"
        yield _bad(services[first].span, message, hint)


def _same_variable(application: ApplicationSource) -> Iterator[Diagnostic]:
    seen: dict[str, str] = {}
    for name in application.services:
        other = seen.setdefault(image_variable(name), name)
        if other != name:
            message = f"'{name}' and '{other}' would both take their image from {image_variable(name)}"
            yield Diagnostic(application.services[name].span, "application-file", message, "rename one of them")


def _several_cids(application: ApplicationSource, of_stack: Collection[str]) -> Iterator[Diagnostic]:
    """Services on another bus than the first, or than what is built in; and warnings of those on several."""
    own = [service for name, service in application.services.items() if name not in of_stack]
    built_in = [cid for service in own if (cid := declared_cid(service.node))]
    buses = [(f"'cid' is {c.text}", c.span, {int(str(c.value))}) for c in application.cids if c not in built_in]
    for service in own:
        if cids := written_cids(service, application):
            numbers = " and ".join(map(str, sorted(cids)))
            place = (declared_cid(service.node) or service).span
            buses.append((f"'{service.name}' is on CID {numbers}", place, cids))
    others = on_other_buses([cids for _, _, cids in buses])
    for what, span, cids in buses:
        if cids in others:
            first = f"{buses[0][0]} in {shown_path(buses[0][1].file)}:{buses[0][1].line}"
            message = f"{what}, and {first}: a test has one bus"
            hint = "leave it out in dodo.yml: application: {files: [...], without: [...]}; or write one CID everywhere"
            yield Diagnostic(span, "application-cid", message, hint)
        elif len(cids) > 1:
            hint = "leave it out in dodo.yml if it passes on messages between them"
            yield Diagnostic(span, "application-cid", f"{what}, which are one bus in a test", hint, "warning")


def on_other_buses(each: Sequence[set[int]]) -> list[set[int]]:
    """The CIDs of those that neither share one with the first, nor are joined to it by what is on several."""
    bus = next((cids for cids in each if cids), set())
    while joined := {cid for cids in each if cids & bus for cid in cids} - bus:
        bus = bus | joined
    return [cids for cids in each if cids and not cids & bus]


def written_cids(service: ComposeService, application: ApplicationSource) -> set[int]:
    """The CIDs of a service: built in, or by commands, variables and files of variables, as far as they are known."""
    every = {**service.file_variables, **variables_of(service, application.known, application.is_late)}
    given = {name: literal(value) or "" for name, value in every.items() if value}
    text = " ".join(filled(literal(word) or "", given) for word, _ in service.words)
    flags = (match["cid"] for part in (text, *given.values()) for match in opendlv_flags.NUMBER.finditer(part))
    built_in = declared_cid(service.node)
    found = (*flags, *map(given.get, opendlv_flags.CID_VARIABLES), str(built_in.value) if built_in else None)
    return {int(cid) for cid in found if cid and _is_cid(cid)}


def _without_cid(application: ApplicationSource) -> Iterator[Diagnostic]:
    services = application.services.values()
    if application.cid is None and not application.speaks_ros and not any(map(takes_cid, services)):
        message = "no service takes a CID (--cid=, CID or OD4SESSION_CID), so every test runs with the built-in one"
        hint = "add --cid=111 to its command, or declare the one that is built in: x-dodo: {cid: 111}"
        yield Diagnostic(next(iter(services)).span, "application-cid", message, hint, "warning")


def takes_cid(service: ComposeService) -> bool:
    variables = variables_of(service, {}, lambda _: True)
    written = [word for key in COMMANDS for word, _ in words_of(service.raw.get(key, service.node.get(key)))]
    found = [*written, *(value for value in variables.values() if value)]
    return opendlv_flags.takes_cid(found, {**service.file_variables, **variables})


def unknown_keys(service: Node) -> Iterator[Diagnostic]:
    entries = source.entries(service)
    for word, entry in entries.items():
        is_near = word.startswith("x-") and difflib.get_close_matches(word.lower(), KEYS, cutoff=0.8)
        if word not in KEYS and (word.startswith("x-dodo") or is_near):
            hint = did_you_mean(word, KEYS)
            severity: Severity = "error" if word.startswith("x-dodo") else "warning"
            yield Diagnostic(entry.key, "unknown-key", f"unknown key '{word}'", hint, severity)


def _name(service: ComposeService) -> Iterator[Diagnostic]:
    name = service.name
    if name == SANDBOX or name.startswith("dodo-"):
        yield _bad(service.span, f"the name '{name}' is reserved for DoDo's own services")
    if not any(plain(service.node).get(key) for key in ("image", "build", "x-dodo-process")):
        yield _bad(service.span, f"'{name}' has neither 'image' nor 'build', so it cannot be started")


def _bad(span: Span, message: str, hint: str = "") -> Diagnostic:
    return Diagnostic(span, "application-file", message, hint)


def _is_cid(value: str) -> bool:
    return value.isascii() and value.isdigit() and len(value) < 9 and 1 <= int(value) <= _HIGHEST
