"""What ``dodo.yml`` says of an application, as if its compose files said it: ``without``, and the keys of ``x-dodo``.

Problems stand at their place in ``dodo.yml``.
"""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from dodo_dsl.application.model import KEYS, with_entry
from dodo_dsl.diagnostics import Diagnostic, Span, did_you_mean, only_fix
from dodo_dsl.source import Entry, Mapping, Node, entries
from dodo_dsl.spec.deployment import Declarations

PROCESS = "process"
"""The key in ``dodo.yml`` for ``x-dodo-process``."""
_DECLARED, _OF_PROCESS = KEYS
_RULE = "application-file"
_SERVICES = "services"


def holding(declarations: Declarations, files: list[Path]) -> Declarations:
    """The declarations where these are the files that they are about, else none."""
    about = [file.resolve() for file in declarations.files]
    return declarations if about == [file.resolve() for file in files] else Declarations()


def left_out(document: Mapping, declarations: Declarations) -> dict[str, str]:
    """Why services do not start, by name: those of ``without`` that the merged compose files have."""
    services = entries(document, _SERVICES)
    return {word.text: "dodo.yml leaves it out" for word in declarations.without if word.text in services}


def declared_in(document: Mapping, declarations: Declarations) -> Mapping:
    """The merged compose files without what is left out, and with what ``dodo.yml`` says of the other services."""
    gone = left_out(document, declarations)
    if declarations.own:
        about = next(iter(declarations.own.values()))
        document = with_entry(document, _DECLARED, _both(document.get(_DECLARED), declarations.own, about.key))
    if not gone and not declarations.services:
        return document
    kept = {
        name: Entry(entry.key, _declared(entry.value, declarations.services[name]))
        if name in declarations.services
        else entry
        for name, entry in entries(document, _SERVICES).items()
        if name not in gone
    }
    return with_entry(document, _SERVICES, Mapping(document.entries[_SERVICES].value.span, kept))


def _declared(service: Node, about: Entry) -> Node:
    """A service of a compose file with the keys of ``dodo.yml`` in place of its own ones."""
    if not isinstance(service, Mapping) or not isinstance(about.value, Mapping):
        return service
    keys = {key: entry for key, entry in about.value.entries.items() if key != PROCESS}
    if keys:
        service = with_entry(service, _DECLARED, _both(service.get(_DECLARED), keys, about.key))
    if PROCESS not in about.value.entries:
        return service
    return replace(service, entries={**service.entries, _OF_PROCESS: about.value.entries[PROCESS]})


def _both(old: Node | None, new: dict[str, Entry], span: Span) -> Mapping:
    """A mapping with other values of keys, at ``span`` if there is none."""
    return Mapping(old.span if old else span, {**entries(old), **new})


def problems(document: Mapping, declarations: Declarations) -> Iterator[Diagnostic]:
    """Unknown services, those that are left out and declared, and what both files say; ``document`` is as written."""
    services = entries(document, _SERVICES)
    named = [(word.text, word.span) for word in declarations.without]
    named += [(name, entry.key) for name, entry in declarations.services.items()]
    taken = [name for name, _ in named]
    for name, span in named:
        if name not in services:
            message = f"the application has no service '{name}'"
            fix = only_fix(name, services, taken)
            yield Diagnostic(span, _RULE, message, did_you_mean(name, services), fix=fix)
    gone = left_out(document, declarations)
    if gone and gone.keys() == services.keys():
        message = "'without' leaves out every service of the application, so that a test has nothing to start"
        yield Diagnostic(
            declarations.without[0].span,
            _RULE,
            message,
            "name a compose file that has the service of your program under 'files'",
        )
    for name, entry in declarations.services.items():
        if name in gone:
            yield Diagnostic(entry.key, _RULE, f"'{name}' is declared, but {gone[name]}", "remove one of them")
