"""Variables of an application: those that a test sets, and those that ``dodo tune`` varies."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace

from dodo_dsl import source
from dodo_dsl.application import opendlv_flags
from dodo_dsl.application.interpolation import filled, literal, names
from dodo_dsl.application.merge import filled_node
from dodo_dsl.application.model import ApplicationSource, ComposeService, environment, plain
from dodo_dsl.application.opendlv_flags import CID_VARIABLES
from dodo_dsl.application.secret_variables import holds_secret, is_steering
from dodo_dsl.diagnostics import Diagnostic
from dodo_dsl.source import Entry, Node, Scalar
from dodo_dsl.spec.vary import Range, of_numbers

_LIBRARIES = ("CLUON_SHAREDMEMORY_POSIX", "VIRTUAL_ENV")
_SPLIT = frozenset("\"'\\;&|<>()`")
_COMMANDS = ("entrypoint", "command")


def owner(name: str) -> str:
    """Why a test may not set a variable; empty if it may."""
    if name in CID_VARIABLES:
        return "it holds the test's own CID"
    if name.upper().startswith("DODO_"):
        return "it is DoDo's own"
    if is_steering(name) or name in _LIBRARIES:
        return "it steers programs and libraries, which the sandbox decides"
    return ""


def split_by(application: ApplicationSource, name: str, value: str) -> str:
    """The service whose command, a string, a value would tear apart with a quotation mark or similar; else empty."""
    for service in application.services.values():
        commands = (service.raw.get(key) for key in _COMMANDS)
        if _SPLIT & set(value) and any(isinstance(c, Scalar) and name in names(c.text) for c in commands):
            return service.name
    return ""


def with_variables(application: ApplicationSource, values: Mapping[str, str]) -> ApplicationSource:
    if not values:
        return application
    known = {**application.known, **values}
    services = {
        name: replace(each, node=with_values(each.node, each.raw, known, application.is_late))
        for name, each in application.services.items()
    }
    return replace(application, services=services)


def with_values(
    service: source.Mapping, raw: Mapping[str, Node], known: Mapping[str, str], is_late: Callable[[str], bool]
) -> source.Mapping:
    """A service with variables filled in where each test may set them; ``raw`` are these values as they are written."""
    made = {key: Entry(service.entries[key].key, filled_node(node, known, is_late)) for key, node in raw.items()}
    return replace(service, entries={**service.entries, **made})


def variables_of(
    service: ComposeService, values: Mapping[str, str], is_late: Callable[[str], bool], given: Iterable[str] = ()
) -> dict[str, str | None]:
    """The environment of a service as compose reads it, with ``values``; None for one that is passed when a test runs.

    It has what its files of variables name of the environment, and those that are ``given`` by the test.
    """
    own: dict[str, str | None] = {}
    raw = service.raw.get("environment")
    for name, value in environment(plain(raw) if raw is not None else None).items():
        if value is not None:
            own[name] = filled(value, values, is_late)
        elif is_late(name):
            own[name] = None
        elif name in values:
            own[name] = values[name].replace("$", "$$")
    of_files = _of_files(service, values, is_late)
    return {**of_files, **own, **{name: values[name].replace("$", "$$") for name in given}}


def variables_with_cid(
    service: ComposeService, values: Mapping[str, str], is_late: Callable[[str], bool], given: Iterable[str], cid: int
) -> dict[str, str | None]:
    """The same with the CID wherever one was, also in the place of one that ``env_file`` would set."""
    found = variables_of(service, values, is_late, given)
    made = {name: value and opendlv_flags.with_cid_text(value, cid) for name, value in found.items()}
    names = [name for name in CID_VARIABLES if name in made or name in service.file_variables]
    return made | dict.fromkeys(names, str(cid))


def _of_files(service: ComposeService, values: Mapping[str, str], is_late: Callable[[str], bool]) -> dict[str, str]:
    """What files of variables take from elsewhere, which compose would look for in its own environment.

    What is only named is empty without a value, as a shell's would be handed over by `docker compose up`.
    As compose reads them: ``values`` come first, then earlier files, then earlier lines of the same one.
    """
    made: dict[str, str] = {}
    before: dict[str, str] = {}
    for file in service.env_files:
        found: dict[str, str] = {}
        for name, value in file.statements:
            if value is None:
                made.update({} if is_late(name) else {name: values.get(name, "").replace("$", "$$")})
                continue
            used = names(value)
            text = filled(value, {**found, **before, **values}, is_late)
            is_own = used <= {*before, *found} - made.keys() - values.keys()
            is_secret = any(holds_secret(each, found.get(each, before.get(each, ""))) for each in used - values.keys())
            if not is_own and not is_secret:
                made[name] = text
            found[name] = literal(text) or ""
        before |= found
    return made


def tunables(application: ApplicationSource) -> tuple[Range, ...]:
    """The parameters of all services, by the names of their variables, in the order in which they are written.

    The application has no ``tunable_problems``; a parameter of several services has one value.
    """
    found: dict[str, Range] = {}
    for service in application.services.values():
        for name, entry in source.entries(service.node, "x-dodo", "tune").items():
            found.setdefault(name, _range(name, entry))
    return tuple(found.values())


def tunable_problems(application: ApplicationSource) -> Iterator[Diagnostic]:
    seen: dict[str, list[str]] = {}
    for service in application.services.values():
        for name, entry in source.entries(service.node, "x-dodo", "tune").items():
            found = _range(name, entry)
            low, high = found.ends
            texts = [end.text for end in (low, high, found.nominal)]
            message = ""
            if why := owner(name):
                message = f"'{name}' cannot be tuned: {why}"
            elif seen.setdefault(name, texts) != texts:
                message = f"'{name}' has another range at another service, expected one: a parameter has one value"
            if message:
                yield Diagnostic(entry.key, "application-file", message)
            else:
                yield from of_numbers(found.nominal, low, high, "", "default")


def _range(name: str, entry: Entry) -> Range:
    low, high, default = (source.part(entry.value, key) for key in ("from", "to", "default"))
    assert isinstance(low, Scalar) and isinstance(high, Scalar) and isinstance(default, Scalar)
    return Range(name, default, (low, high))
