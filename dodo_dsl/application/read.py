"""``read_application``: compose files as DoDo understands them, or what is wrong with them."""

import itertools
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from dodo_dsl import source
from dodo_dsl.application import opendlv_flags
from dodo_dsl.application.compose_files import Files
from dodo_dsl.application.host_access import references
from dodo_dsl.application.interpolation import names
from dodo_dsl.application.load import load
from dodo_dsl.application.model import ApplicationSource, declared, environment, plain, text
from dodo_dsl.application.problems import Written, problems, unknown_keys
from dodo_dsl.application.service_environment import env_files, image_variable, told_in_files
from dodo_dsl.diagnostics import Diagnostic, did_you_mean, has_errors
from dodo_dsl.spec.schema import validate

MAX_SERVICES = 256
INTERPRETERS = ("python", "python3", "sh", "bash", "node", "perl", "ruby")
_OURS = ("services", "version", "name", "networks", "include")


def read_application(path: Path | Sequence[Path]) -> tuple[ApplicationSource | None, list[Diagnostic]]:
    """An application from one compose file, or from several that are merged in order, and what is wrong with it."""
    paths = [path] if isinstance(path, Path) else list(path)
    files = Files()
    document = load(files, paths)
    found = files.problems
    services = document.get("services") if document else None
    if isinstance(services, source.Mapping):
        found.extend(itertools.chain.from_iterable(unknown_keys(e.value) for e in services.entries.values()))
        if len(services.entries) > MAX_SERVICES:
            found.append(Diagnostic(services.span, "too-large", f"more than {MAX_SERVICES} services"))
    if document is not None and not any(p.rule != "unknown-key" for p in found if p.severity == "error"):
        found.extend(validate(document, "application"))
    if document is None or not isinstance(services, source.Mapping) or has_errors(found):
        return None, found
    application = _application(paths[0].resolve(), document, services, files.variables)
    found.extend(_judged(application, services, paths[0].parent))
    return (None if has_errors(found) else application), found


def _application(
    path: Path, document: source.Mapping, services: source.Mapping, variables: Mapping[str, str]
) -> ApplicationSource:
    dropped = {name: why for name, entry in services.entries.items() if (why := _why_dropped(plain(entry.value)))}
    kept = {n: e for n, e in services.entries.items() if n not in dropped and isinstance(e.value, source.Mapping)}
    nodes = {name: entry.value for name, entry in kept.items() if isinstance(entry.value, source.Mapping)}
    rest = {k: e.value for k, e in document.entries.items() if k not in _OURS and not k.startswith("x-")}
    return ApplicationSource(
        path=path,
        services=nodes,
        rest=rest,
        spans={name: entry.key for name, entry in kept.items()},
        declared={name: declared(node) for name, node in nodes.items()},
        dropped=dropped,
        containers={str(c): n for n, node in nodes.items() if (c := plain(node).get("container_name"))},
        variables={**variables, **dict.fromkeys(_cid_variables(nodes.values()), "")},
    )


def _cid_variables(services: Iterable[source.Mapping]) -> list[str]:
    """The CID variables that something in the file is made of."""
    texts = (node.text for service in services for node in source.walk(service) if isinstance(node, source.Scalar))
    spoken_of = {name for text in texts for name in names(text)}
    return [variable for variable in opendlv_flags.CID_VARIABLES if variable in spoken_of]


def _why_dropped(service: dict[str, Any]) -> str:
    profiles = [str(p) for p in service.get("profiles") or ()]
    if profiles:
        return f"it waits for profile {' or '.join(profiles)}"
    deploy = service.get("deploy") or {}
    return "it is scaled to 0" if 0 in (service.get("scale"), deploy.get("replicas")) else ""


def _judged(application: ApplicationSource, services: source.Mapping, folder: Path) -> Iterator[Diagnostic]:
    if not application.services:
        first = next(iter(services.entries.values())).key
        message = "no service starts, for each one waits for a profile"
        yield Diagnostic(first, "application-file", message, "give one service no 'profiles'")
        return
    found: list[Diagnostic] = []
    volumes = plain(application.rest["volumes"]) if "volumes" in application.rest else {}
    for name, node in application.services.items():
        others = frozenset(application.services)
        written = Written(
            name,
            node,
            application.spans[name],
            others,
            application.dropped,
            dict(application.containers),
            volumes or {},
        )
        found.extend(problems(written))
        found.extend(_missing_files(node, folder))
        found.extend(_missing_program(node, folder))
    found.extend(_circles(application))
    found.extend(_same_variable(application))
    yield from found
    if not has_errors(found):
        yield from _without_cid(application)


def _missing_files(node: source.Mapping, folder: Path) -> Iterator[Diagnostic]:
    for word, required in env_files(node):
        is_local = not word.text.startswith(("/", "~")) and "$" not in word.text
        if required and is_local and not (folder / word.text).is_file():
            hint = "write it, or {path: ..., required: false}"
            yield Diagnostic(word.span, "application-file", f"there is no file '{word.text}' beside this one", hint)


def _missing_program(node: source.Mapping, folder: Path) -> Iterator[Diagnostic]:
    """A script of ``x-dodo-process`` that is not there; other programs may be built later, or lie in the PATH."""
    process = node.get("x-dodo-process")
    words = process.items if isinstance(process, source.Sequence) else ()
    if len(words) < 2 or plain(words[0]) not in INTERPRETERS:
        return
    script = words[1]
    text = script.text if isinstance(script, source.Scalar) else ""
    if text and not text.startswith("-") and "$" not in text and not (folder / text).is_file():
        message = f"there is no file '{text}' beside this one for {plain(words[0])} to run"
        beside = [path.name for path in folder.iterdir() if path.suffix == Path(text).suffix]
        hint = did_you_mean(Path(text).name, beside) or "without it the application starts in containers only"
        yield Diagnostic(script.span, "application-file", message, hint, "warning")


def _circles(application: ApplicationSource) -> Iterator[Diagnostic]:
    """A service that waits for itself, over whatever others."""
    containers = dict(application.containers)
    needs = {
        name: {other for _, other in references(plain(node), containers) if other in application.services}
        for name, node in application.services.items()
    }
    waiting = set(_never_ready(needs))
    wanted_by: dict[str, set[str]] = {name: set() for name in needs}
    for name in waiting:
        for other in needs[name]:
            wanted_by[other].add(name)
    circle = [name for name in _never_ready(wanted_by) if name in waiting]
    if circle:
        message = f"services wait for one another: {', '.join(circle[:6])}{', ...' if len(circle) > 6 else ''}"
        yield Diagnostic(application.spans[circle[0]], "application-file", message, "one of them must start first")


def _never_ready(needs: Mapping[str, set[str]]) -> Iterator[str]:
    """Those that wait for themselves, or for such a one."""
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
            yield Diagnostic(application.spans[name], "application-file", message, "rename one of them")


def _without_cid(application: ApplicationSource) -> Iterator[Diagnostic]:
    """A warning when no service can be told which CID to use."""
    if any(_takes_cid(node, application.folder) for node in application.services.values()):
        return
    first = next(iter(application.spans.values()))
    message = "no service takes a CID (--cid=, CID or OD4SESSION_CID), so each test runs with the one built in"
    yield Diagnostic(first, "application-cid", message, "add --cid=111 to its command", "warning")


def _takes_cid(node: source.Mapping, folder: Path) -> bool:
    service = plain(node)
    variables = environment(service.get("environment"))
    words = [*_words(service.get("entrypoint")), *_words(service.get("command")), *(v for v in variables.values() if v)]
    return opendlv_flags.takes_cid(words, {**variables, **dict.fromkeys(told_in_files(node, folder))})


def _words(command: Any) -> list[str]:
    return [command] if isinstance(command, str) else [text(word) for word in command or ()]
