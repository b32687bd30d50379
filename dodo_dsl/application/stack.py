"""The OpenDLV services that stand around an application on a car: what of DoDo takes their place in a test.

``STACK`` is the one table. A service is recognised by its image, by the repository it is built from, or by the program
that it starts; one with ``x-dodo`` is the application's own, as the team says what it sends and takes.
"""

import re
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from dodo_dsl import source
from dodo_dsl.application.model import COMMANDS, ApplicationSource, ComposeService, words_of
from dodo_dsl.diagnostics import Diagnostic, Severity
from dodo_dsl.source import Scalar

RULE = "application-stack"


class Part(NamedTuple):
    """A service of the stack: its ``names``, a pattern, and what a test has ``instead``.

    ``is_world`` means that it makes what a test's environment or action makes, so that both would speak.
    """

    names: str
    instead: str
    is_world: bool = False


STACK = (
    Part(
        r"opendlv-vehicle-view|opendlv-signal-viewer|opendlv-ui-.+",
        "dodo run records each test, and its report replays it on a page",
    ),
    Part(
        r"opendlv-video-.+-(decoder|viewer)|opendlv-image-viewer|(video-)?(h26[45]|x26[45]|openh264|vp[89])-?decoder",
        "virtual-camera, rec-replay or a rig's camera puts the pictures into the shared memory",
    ),
    Part(
        r"opendlv-(video|device-camera)-.+-(encoder|recorder)|(video-)?(h26[45]|x26[45]|openh264|vp[89])-?encoder",
        "the recording of a test keeps its pictures, as 'record: {frames: ...}' says",
    ),
    Part(
        r"opendlv-(data-)?(rec-)?replay(-.+)?|cluon-(rec-)?(re)?play(er)?|cluon-filter",
        "rec-replay plays a recording, with its pictures",
        is_world=True,
    ),
    Part(r"opendlv-(virtual|sim)-camera(-.+)?", "virtual-camera draws the same maps", is_world=True),
    Part(r"opendlv-(virtual-space|sim-global|sim-space)(-.+)?", "integrator makes the vehicle's Frame", is_world=True),
    Part(
        r"opendlv-(virtual|sim)-motor-kiwid.*",
        "dynamic-model with drive: differential moves the vehicle",
        is_world=True,
    ),
    Part(r"opendlv-(virtual|sim)-motor-.+", "dynamic-model moves the vehicle", is_world=True),
    Part(
        r"opendlv-(virtual|sim)-(rangefinder|ultrasonic|ir|lidar|adc).*",
        "range-finder measures distances",
        is_world=True,
    ),
    Part(
        r"opendlv-(virtual|sim)-(imu|gps|inertial|accelerometer|gyroscope|magnetometer).*",
        "inertial-sensor measures the motion",
        is_world=True,
    ),
    Part(r"opendlv-(virtual|sim)-.+", "the services of environment and action simulate the vehicle", is_world=True),
    Part(r"opendlv-logic-distance-voltage(-.+)?", "range-finder sends distances, also of infrared sensors by a curve"),
    Part(
        r"opendlv-device-(camera|video)-.+",
        "virtual-camera, rec-replay or a rig's camera puts the pictures into the shared memory",
    ),
    Part(
        r"opendlv-device-.+",
        "a test's sensors and motors are services of its environment and action",
    ),
    Part(
        r"cluon-(OD4toStdout|OD4toJSON|OD4toStdoutJSON|OD4toUDP|UDPtoOD4|livefeed|rec2csv|relay|recorder|rec)"
        r"|opendlv-(logger|recorder|rec-.+)",
        "each test is recorded; dodo rec info and dodo rec export show what was said",
    ),
)
_PLATFORM = re.compile(r"(\.git|-(multi|amd64|x86_64|armhf|arm64|arm|aarch64|alpine|dev|v?[0-9][0-9.]*))+$")
_IMAGE = re.compile(r"(?:.*/)?(?P<name>[A-Za-z0-9._-]+)(?:[:@#].*)?", re.DOTALL)
_SHELLS = ("sh", "ash", "bash", "dash", "zsh")


def part(service: ComposeService) -> tuple[str, Part] | None:
    """Which part of the stack a service is, by the name under which it is known; None for the application's own."""
    rows = ((name, row) for name in _names(service) for row in STACK if re.fullmatch(row.names, name))
    return next(rows, None) if service.declared is None else None


def _names(service: ComposeService) -> Iterator[str]:
    """What the service may be known by: its image, the repository it is built from, and the program it starts."""
    image, context = service.node.get("image"), source.part(service.node, "build", "context")
    if isinstance(image, Scalar) and (match := _IMAGE.fullmatch(image.text)):
        yield _PLATFORM.sub("", match["name"])
    if isinstance(context, Scalar):
        parts = [part for part in re.split(r"[/#?]", context.text) if part]
        yield from (_PLATFORM.sub("", part) for part in (parts if "://" in context.text else parts[-1:]))
    process, entrypoint, command = ([word for word, _ in words_of(service.node.get(key))] for key in COMMANDS)
    yield from map(_program, ([*entrypoint, *command], command, process))


def _program(words: Sequence[str]) -> str:
    """The program that a command starts, also as the only one of a shell."""
    name = words[0].rpartition("/")[2] if words else ""
    if name in _SHELLS and len(words) == 3 and not {*";&|\n"} & {*words[2]}:
        return _program(words[2].split())
    return name


def parts(application: ApplicationSource) -> dict[str, tuple[str, Part]]:
    """The services of the stack that the application starts, by name."""
    return {name: found for name, service in application.services.items() if (found := part(service))}


def problem(application: ApplicationSource, name: str, found: tuple[str, Part], is_refused: bool) -> Diagnostic:
    """A service of the stack in a test: an error where it contradicts the test's own, or ``is_refused`` anyway."""
    known, row = found
    called = f"'{name}'" if known == name else f"'{name}' ({known})"
    hint = f"leave it out in dodo.yml: {way_out(application.named, [*application.without, *parts(application)])}"
    span = application.services[name].span
    severity: Severity = "error" if is_refused or row.is_world else "warning"
    return Diagnostic(span, RULE, f"{called} is not for tests: {row.instead}", hint, severity)


def way_out(files: Sequence[str], without: Sequence[str]) -> str:
    """The line of ``dodo.yml`` that leaves services out."""
    return f"application: {{files: [{', '.join(files)}], without: [{', '.join(without)}]}}"
