"""Problems of an application: of each service by itself, and of all of them together.

A service has names, commands, references, and what cannot be isolated; together they have missing files, cycles of
dependencies, and no service that takes a CID.
"""

import functools
import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from dodo_dsl import source
from dodo_dsl.application import host_access, opendlv_flags, stack
from dodo_dsl.application.access.findings import service_findings
from dodo_dsl.application.access.model import Look, diagnostic, place
from dodo_dsl.application.compose_paths import is_local
from dodo_dsl.application.host_access import is_true, references
from dodo_dsl.application.interpolation import interpolated, interpolated_node
from dodo_dsl.application.model import (
    KEYS,
    SANDBOX,
    ApplicationSource,
    ComposeService,
    declared_cid,
    environment,
    image_variable,
    plain,
)
from dodo_dsl.application.mounts import missing_folders, nested_mounts
from dodo_dsl.application.slips import cid_slips, is_cid, missing_program, words
from dodo_dsl.diagnostics import Diagnostic, Fix, Span, closest, did_you_mean, has_errors, only_fix, shown_path
from dodo_dsl.source import Node

_CONDITIONS = ("service_started", "service_healthy", "service_completed_successfully")

_DRIVE = re.compile(r"[A-Za-z]:[/\\]")

_GIVE_CID = "add --cid=111 to its command, or declare the one that is built in: x-dodo: {cid: 111}"
_LONGEST_HOST = 64
"""Bytes of a host's name, and of its domain's (utsname(7))."""
_LONGEST_TEXT = 131_072
"""Bytes from which on a program takes no argument and no variable (MAX_ARG_STRLEN, with its end)."""
_LONGEST = 63
"""A service's name is also one in the test's network (RFC 1035)."""


def application_problems(application: ApplicationSource, first: Span) -> Iterator[Diagnostic]:
    """Everything wrong with the services and their references; ``first`` is the place of the first service written."""
    if not application.services:
        message = "no service starts, because each one has a profile or is scaled to 0"
        yield Diagnostic(first, "application-file", message, "remove 'profiles' from one service")
        return
    volumes = plain(application.rest["volumes"]) if "volumes" in application.rest else {}
    found: list[Diagnostic] = []
    of_stack = stack.parts(application)
    for name, service in application.services.items():
        own = [*problems(Written.of(service, application, volumes or {})), *_missing_files(service, application)]
        own += [*_missing_folder(service, application), *missing_program(service, application.folder)]
        part = of_stack.get(name)
        found.extend([stack.problem(application, name, part, has_errors(own))] if part else own)
    found.extend(nested_mounts(application))
    found.extend(missing_folders(application))
    found.extend(_cycles(application))
    found.extend(_never_healthy(application))
    found.extend(_same_variable(application))
    found.extend(_several_cids(application, of_stack))
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
    gone = [*application.without, *of_stack, *(s.name for s in own if written_cids(s, application) in others)]
    for what, span, cids in buses:
        if cids in others:
            first = f"{buses[0][0]} in {shown_path(buses[0][1].file)}:{buses[0][1].line}"
            hint = f"leave out what is not under test, as dodo.yml can: {stack.way_out(application.named, gone)}"
            message = f"{what}, and {first}: a test has one bus"
            yield Diagnostic(span, "application-cid", message, f"{hint}; or write one CID everywhere")
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
    known = application.known
    given = {**service.file_variables, **environment(plain(service.node).get("environment"))}
    filled = {
        name: known.get(name, "") if value is None else interpolated(value, known) for name, value in given.items()
    }
    text = " ".join(interpolated(interpolated(word, known), filled) for word, _ in words(service))
    flags = (match["cid"] for part in (text, *filled.values()) for match in opendlv_flags.NUMBER.finditer(part))
    built_in = declared_cid(service.node)
    found = (*flags, *map(filled.get, opendlv_flags.CID_VARIABLES), str(built_in.value) if built_in else None)
    return {int(cid) for cid in found if cid and is_cid(cid)}


def _without_cid(application: ApplicationSource) -> Iterator[Diagnostic]:
    """Warnings of flags that give no CID, of services with messages that take none, and of none that does."""
    services = application.services.values()
    slips = {service.name: list(cid_slips(service, takes_cid(service))) for service in services}
    yield from (slip for found in slips.values() for slip in found)
    if application.cid is not None:
        return
    without = [service for service in services if not slips[service.name] and not takes_cid(service)]
    if len(without) == len(services):
        message = "no service takes a CID (--cid=, CID or OD4SESSION_CID), so every test runs with the built-in one"
        yield Diagnostic(without[0].span, "application-cid", message, _GIVE_CID, "warning")
        return
    for service in without:
        if service.declared and (service.declared.inputs or service.declared.outputs):
            message = f"'{service.name}' has messages, but takes no CID (--cid=, CID or OD4SESSION_CID)"
            yield Diagnostic(service.span, "application-cid", message, _GIVE_CID, "warning")


def takes_cid(service: ComposeService) -> bool:
    """Whether the CID of a service can be set."""
    variables = environment(plain(service.node).get("environment"))
    found = [*(word for word, _ in words(service)), *(value for value in variables.values() if value)]
    return opendlv_flags.takes_cid(found, {**variables, **dict.fromkeys(service.cid_variables)})


@dataclass(frozen=True)
class Written:
    """A service in its application; ``others`` are all services that start, ``dropped`` has why others do not.

    ``filled`` is ``node`` with the known variables filled in.
    """

    name: str
    node: source.Mapping
    key: Span
    others: frozenset[str]
    dropped: Mapping[str, str]
    containers: dict[str, str]
    filled: Node
    look: Look

    @classmethod
    def of(cls, service: ComposeService, application: ApplicationSource, volumes: Mapping[str, Any]) -> "Written":
        """The service among the others of its application; ``volumes`` are the application's named ones."""
        others, containers = frozenset(application.services), dict(application.containers)
        ports, limits = application.access.ports, application.limits
        look = Look(application.paths, containers=containers, volumes=volumes, ports=ports, limits=limits)
        seen = interpolated_node(service.node, application.known)
        return cls(service.name, service.node, service.span, others, application.dropped, containers, seen, look)

    @functools.cached_property
    def plain(self) -> dict[str, Any]:
        value: dict[str, Any] = plain(self.node)
        return value

    def place(self, key: str) -> Span:
        """The place of a key's value."""
        return place(self.node, (key,), self.key)


def problems(written: Written) -> Iterator[Diagnostic]:
    """Everything wrong with one service."""
    for rule in (_name, _display, _commands, _references, _conditions, _volumes, _unmounted, _access, _single, _engine):
        yield from rule(written)


def unknown_keys(service: Node) -> Iterator[Diagnostic]:
    """Unknown keys that begin like DoDo's."""
    entries = service.entries if isinstance(service, source.Mapping) else {}
    for word, entry in entries.items():
        if word.startswith("x-dodo") and word not in KEYS:
            hint, fix = did_you_mean(word, KEYS), only_fix(word, KEYS, entries)
            yield Diagnostic(entry.key, "unknown-key", f"unknown key '{word}'", hint, fix=fix)
        elif word not in KEYS and word.startswith("x-do") and did_you_mean(word, KEYS).startswith("did"):
            message = f"neither compose nor DoDo uses the key '{word}'"
            yield Diagnostic(entry.key, "unknown-key", message, did_you_mean(word, KEYS), "warning")


def _name(written: Written) -> Iterator[Diagnostic]:
    name = written.name
    if name == SANDBOX or name.startswith("dodo-"):
        yield _bad(written.key, f"the name '{name}' is reserved for DoDo's own services")
    if len(name) > _LONGEST:
        yield _bad(written.key, f"the name of a service has {len(name)} characters, expected at most {_LONGEST}")
    if not any(written.plain.get(key) for key in ("image", "build", "x-dodo-process")):
        yield _bad(written.key, f"'{name}' has neither 'image' nor 'build', so it cannot be started")


def _display(written: Written) -> Iterator[Diagnostic]:
    """A warning of an X server that only a process gets."""
    about = written.plain.get(KEYS[0])
    if isinstance(about, dict) and about.get("display") is True and KEYS[1] not in written.plain:
        message = f"'display' of '{written.name}' has no effect in a container, whose image brings its own X server"
        hint = "start it with xvfb-run there, or give it x-dodo-process; docs/reference/applications.md, Windows"
        yield Diagnostic(
            place(written.node, (KEYS[0], "display"), written.key), "application-file", message, hint, "warning"
        )


def _commands(written: Written) -> Iterator[Diagnostic]:
    for key in ("entrypoint", "command"):
        value = written.plain.get(key)
        if isinstance(value, str):
            try:
                opendlv_flags.split(value)
            except ValueError as error:
                yield _bad(written.place(key), f"'{key}' of '{written.name}': {error}")


def _references(written: Written) -> Iterator[Diagnostic]:
    for key, name in host_access.references(written.plain, written.containers):
        if name in written.others or (name in written.dropped and key != "volumes_from"):
            continue
        if name in written.dropped:
            message = f"'{name}', whose volumes '{written.name}' uses, does not start: {written.dropped[name]}"
            yield _bad(written.place(key), message)
        else:
            hint = did_you_mean(name, written.others)
            message = f"'{key}' of '{written.name}' names the unknown service '{name}'"
            fix = only_fix(name, written.others, _taken(written, key))
            yield _bad(_of_name(written, key, name), message, hint, fix)


def _conditions(written: Written) -> Iterator[Diagnostic]:
    """What compose does not know of ``depends_on``."""
    needed = written.plain.get("depends_on")
    for name, about in needed.items() if isinstance(needed, dict) else ():
        condition = about.get("condition") if isinstance(about, dict) else None
        if isinstance(condition, str) and condition not in _CONDITIONS and "$" not in condition:
            message = f"'{condition}' is not a condition of 'depends_on'"
            near = closest(condition, _CONDITIONS)
            hint = f"did you mean '{near[0]}'?" if near else f"known: {', '.join(_CONDITIONS)}"
            yield _bad(place(written.node, ("depends_on", name, "condition"), written.key), message, hint)


def _taken(written: Written, key: str) -> list[str]:
    """The services that a key cannot name, too: those that it names already, and the service itself."""
    named = host_access.references(written.plain, written.containers)
    return [written.name, *(name for other, name in named if other == key)]


def _of_name(written: Written, key: str, name: str) -> Span:
    """The place of a service's name in the value of a key."""
    node = written.node.get(key)
    if isinstance(node, source.Mapping) and name in node.entries:
        return node.entries[name].key
    items = node.items if isinstance(node, source.Sequence) else ()
    fits = (item.span for item in items if isinstance(item, source.Scalar) and name in item.text.split(":"))
    return next(fits, written.place(key))


def _volumes(written: Written) -> Iterator[Diagnostic]:
    """Named volumes that are not declared, which compose refuses; a test may set the variables of others."""
    known = written.look.volumes
    for item, volume in enumerate(written.plain.get("volumes") or ()):
        if isinstance(volume, str) and _DRIVE.match(volume):
            message = f"compose takes '{volume[:2]}' of '{volume}' for a drive of Windows, and mounts no volume"
            yield _bad(place(written.node, ("volumes", item), written.key), message, "give the volume a longer name")
        name = host_access.named_volume(volume)
        if name and name not in known:
            steps = ("volumes", item, "source") if isinstance(volume, dict) else ("volumes", item)
            hint = did_you_mean(name, known)
            hint = hint if hint.startswith("did") else f"declare it at the end of the file: 'volumes: {{{name}: }}'"
            message = f"'{written.name}' mounts the volume '{name}', which the top-level 'volumes' do not declare"
            near = only_fix(name, known)
            fix = Fix(f"{name}:/", f"{near.new}:/") if near and isinstance(volume, str) else near
            yield _bad(place(written.node, steps, written.key), message, hint, fix)


def _unmounted(written: Written) -> Iterator[Diagnostic]:
    """A warning of a volume that a process lacks; it has its own folder, the test's ``/tmp`` and devices."""
    of_machine = (host_access.is_shared_memory, host_access.is_hardware, host_access.is_machine)
    for item, volume in enumerate(written.plain.get("volumes") or () if KEYS[1] in written.plain else ()):
        found = host_access.mount(volume)
        own = found.source in (found.target, ".", "./")
        if not (own or found.below("/tmp") or any(check(found) for check in of_machine)):
            span = place(written.node, ("volumes", item), written.key)
            what = f"the process of '{written.name}' has no '{found.target}', as volumes are mounted in containers only"
            hint = (
                f"it starts in this file's folder: name '{found.source}' there in its command, or use --backend docker"
            )
            yield Diagnostic(span, "application-file", what, hint, "warning")
            return


def _access(written: Written) -> Iterator[Diagnostic]:
    for finding in service_findings(written.name, plain(written.filled), written.look):
        yield diagnostic(finding, written.node, written.key)


def _single(written: Written) -> Iterator[Diagnostic]:
    service = written.plain
    deploy = service.get("deploy") or {}
    for key, value in (("scale", service.get("scale")), ("deploy", deploy.get("replicas"))):
        if isinstance(value, int) and value > 1:
            message = f"'{written.name}' has {value} replicas, but starts once in a test"
            yield Diagnostic(written.place(key), "application-file", message, "", "warning")


def _engine(written: Written) -> Iterator[Diagnostic]:
    """What the kernel or the engine refuses, and compose does not see: long names and texts, images in capitals."""
    seen = plain(written.filled)
    for key in ("hostname", "domainname"):
        value = seen.get(key)
        if isinstance(value, str) and "$" not in value and len(value.encode()) > _LONGEST_HOST:
            message = f"'{key}' of '{written.name}' has {len(value.encode())} bytes, and Linux takes {_LONGEST_HOST}"
            yield _bad(written.place(key), message, "shorten it")
    image = str(seen.get("image") or "")
    if "$" not in image and (name := _repository(image)) != name.lower():
        hint = f"write {image.replace(name, name.lower(), 1)}"
        yield _bad(written.place("image"), f"the image '{image}' has capitals, which no engine takes in its name", hint)
    texts = [(key, f"{key}={value}") for key, value in environment(seen.get("environment")).items()]
    words = seen.get("command")
    texts += [("command", str(word)) for word in words] if isinstance(words, list) else []
    for name, word in texts:
        if len(word.encode()) >= _LONGEST_TEXT:
            message = (
                f"'{name}' of '{written.name}' has {len(word.encode()):,} bytes, expected fewer than {_LONGEST_TEXT:,}"
            )
            key = "command" if name == "command" else "environment"
            yield _bad(written.place(key), message, "put it into a file that the service mounts")


def _repository(image: str) -> str:
    """The part of an image's name that is in small letters: without registry, tag and digest."""
    host, sign, rest = image.partition("@")[0].partition("/")
    has_host = bool(sign) and ("." in host or ":" in host or host == "localhost")
    name = rest if has_host else f"{host}{sign}{rest}"
    return name.partition(":")[0]


def _bad(span: Span, message: str, hint: str = "", fix: Fix | None = None) -> Diagnostic:
    return Diagnostic(span, "application-file", message, hint, fix=fix)
