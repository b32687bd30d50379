"""The OpenDLV services that stand around an application on a car: what of DoDo takes their place in a test.

A service is recognised by its image, by the repository it is built from, or by the program that it starts; one with
``x-dodo`` is the application's own, as the team says what it sends and takes.
"""

import re
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from dodo_dsl import source
from dodo_dsl.application.model import COMMANDS, ApplicationSource, ComposeService, words_of
from dodo_dsl.diagnostics import Diagnostic, Severity
from dodo_dsl.source import Scalar


class Part(NamedTuple):
    """Services of the stack: a pattern of their ``names``, and what a test has ``instead``.

    ``is_world`` means that they make what a test's environment or action makes, so that both would speak.
    """

    names: str
    instead: str
    is_world: bool = False


STACK = (
    Part(
        r"opendlv-((data-)?(rec-)?replay|virtual|sim)(-.+)?|cluon-(rec-)?(re)?play(er)?|cluon-filter",
        "virtual-camera, rec-replay, dynamic-model, range-finder and others make the world of a test",
        is_world=True,
    ),
    Part(
        r"opendlv-((device|video|ui)-.+|vehicle-view|(signal|image)-viewer|logic-distance-voltage(-.+)?|logger|recorder|rec-.+)"
        r"|(video-)?(h26[45]|x26[45]|openh264|vp[89])-?(de|en)coder"
        r"|cluon-(OD4to(Stdout|JSON|StdoutJSON|UDP)|UDPtoOD4|livefeed|rec2csv|relay|recorder|rec)",
        "services of the test make pictures and readings, and DoDo records it and shows it on a page",
    ),
)
_PLATFORM = re.compile(r"(\.git|-(multi|amd64|x86_64|armhf|arm64|arm|aarch64|alpine|dev|v?[0-9][0-9.]*))+$")
_IMAGE = re.compile(r"(?:.*/)?(?P<name>[A-Za-z0-9._-]+)(?:[:@#].*)?", re.DOTALL)
_SHELLS = ("sh", "ash", "bash", "dash", "zsh")


def parts(application: ApplicationSource) -> dict[str, tuple[str, Part]]:
    return {
        service.name: (name, row)
        for service in application.services.values()
        if service.declared is None
        for name in reversed([*_names(service)])
        for row in reversed(STACK)
        if re.fullmatch(row.names, name)
    }


def _names(service: ComposeService) -> Iterator[str]:
    """What the service may be known by: its image, the repository it is built from, and the program it starts."""
    image, context = service.node.get("image"), source.part(service.node, "build", "context")
    if isinstance(image, Scalar) and (match := _IMAGE.fullmatch(image.text)):
        yield _PLATFORM.sub("", match["name"])
    if isinstance(context, Scalar):
        words = [word for word in re.split(r"[/#?]", context.text) if word]
        yield from (_PLATFORM.sub("", word) for word in (words if "://" in context.text else words[-1:]))
    process, entrypoint, command = ([word for word, _ in words_of(service.node.get(key))] for key in COMMANDS)
    yield from map(_program, ([*entrypoint, *command], command, process))


def _program(words: Sequence[str]) -> str:
    name = words[0].rpartition("/")[2] if words else ""
    if name in _SHELLS and len(words) == 3 and not {*";&|\n"} & {*words[2]}:
        return _program(words[2].split())
    return name


def problem(service: ComposeService, found: tuple[str, Part], others: Sequence[str], is_refused: bool) -> Diagnostic:
    """A service of the stack in a test: an error where it contradicts the test's own, or ``is_refused`` anyway."""
    known, row = found
    message = f"'{service.name}' ({known}) is not for tests: {row.instead}"
    hint = f"leave it out in dodo.yml: application: {{files: [...], without: [{', '.join(others)}]}}"
    severity: Severity = "error" if is_refused or row.is_world else "warning"
    return Diagnostic(service.span, "application-stack", message, hint, severity)
