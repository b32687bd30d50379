"""``camera-source``: what a rig's computer can take pictures from, in which sizes, and how often.

``camera-size``: a camera's optics, as they were measured, are those of pictures of one size. ``out-of-range``: sizes
are even.
"""

import math
from collections.abc import Iterator
from pathlib import PurePath

from dodo_dsl.check.context import RuleContext
from dodo_dsl.diagnostics import Diagnostic, Span, closest, did_you_mean
from dodo_dsl.spec.arguments import Argument, ResolvedService
from dodo_dsl.spec.deployment.rig import CAMERA_SOURCE, EMULATED, RPICAM, Rig

_FILE = "file"
_NAMES = (RPICAM, _FILE, EMULATED)
_ALIGNED = 64
"""Rows of other widths are padded in the pipe of ``rpicam-vid``."""

_I420 = "name.i420"
_OPTICS = "camera.intrinsics"


def check(context: RuleContext) -> Iterator[Diagnostic]:
    for service in context.services:
        yield from _size(context.rig, service)
        yield from _odd(service)
        for argument in service.arguments.values():
            if argument.parameter.rig == CAMERA_SOURCE and argument.text:
                yield from _problems(context, service, argument)
                yield from _exposure(service, argument.text)


def _problems(context: RuleContext, service: ResolvedService, argument: Argument) -> Iterator[Diagnostic]:
    source, span = argument.text or "", _span(service, argument)
    if source not in _NAMES and not source.startswith("/dev/") and not PurePath(source).suffix:
        known = "write a device such as /dev/video0, rpicam or file"
        hint = did_you_mean(source, _NAMES) if closest(source, _NAMES) else known
        yield Diagnostic(span, "camera-source", f"'{source}' is not a source of pictures", hint)
    elif source == EMULATED and context.rig is not None and not context.rig.is_emulated:
        message = f"rig '{context.rig.name}' is hardware, and an emulated camera sees nothing of it"
        yield Diagnostic(span, "camera-source", message, "write a device such as /dev/video0, or rpicam")
    elif source == _FILE and _FILE not in service.use.parameters:
        message = f"'{service.use.name}' has the source 'file', but no 'file' to take pictures from"
        yield Diagnostic(span, "camera-source", message, "write 'file: ...' under 'with' in the test, or a device")
    elif source == RPICAM and (width := service.texts.get("width", "")).isdigit() and int(width) % _ALIGNED:
        message = f"rpicam-vid gives pictures whose width is a multiple of {_ALIGNED}, not {width}"
        hint = f"write a width of {max(int(width) // _ALIGNED, 1) * _ALIGNED}"
        yield Diagnostic(span, "camera-source", message, hint)


def _odd(service: ResolvedService) -> Iterator[Diagnostic]:
    """Sizes that pictures in I420 cannot have, where a colour is that of two by two pixels."""
    for name in ("width", "height") if _I420 in service.arguments else ():
        argument, text = service.arguments.get(name), service.texts.get(name, "")
        if argument and text.isdigit() and int(text) % 2 and (name, service.texts.get("source")) != ("width", RPICAM):
            message = f"parameter '{name}' is {text}, expected an even number"
            yield Diagnostic(
                _span(service, argument), "out-of-range", message, f"write for example {max(int(text) - 1, 2)}"
            )


def _exposure(service: ResolvedService, source: str) -> Iterator[Diagnostic]:
    """Pictures of a real camera that would come faster than it can expose them."""
    if source != RPICAM and not source.startswith("/dev/"):
        return
    try:
        rate, exposure = (float(service.texts[name]) for name in ("freq", "exposure"))
    except (KeyError, ValueError):
        return
    if rate * exposure > 1 + 1e-9:
        places = (service.use.parameters.get(name) for name in ("exposure", "freq"))
        span = next((entry.value.span for entry in places if entry), service.use.span)
        message = f"an exposure of {exposure * 1e3:g} ms does not fit into the {1e3 / rate:.3g} ms between two pictures"
        most, fastest = math.floor(1e4 / rate) / 10, math.floor(10 / exposure) / 10
        hint = f"write an exposure of at most {most:g} ms, or a freq of at most {fastest:g} Hz"
        yield Diagnostic(span, "camera-source", message, hint)


def _size(rig: Rig | None, service: ResolvedService) -> Iterator[Diagnostic]:
    """A service that takes optics from the rig and works on pictures of another size."""
    taken = (a.parameter for a in service.arguments.values() if (a.parameter.rig or "").startswith(_OPTICS))
    if rig is None or not any(p.name not in service.use.parameters and rig.entry(p.rig or "") for p in taken):
        return
    measured = [rig.text(f"{_OPTICS}.{name}") for name in ("width", "height")]
    given = [service.texts.get(name, "") for name in ("width", "height")]
    if all(measured) and all(given) and measured != given:
        where = service.use.parameters.get("width") or rig.entry(f"{_OPTICS}.width")
        message = f"the camera of rig '{rig.name}' was measured in pictures of {' x '.join(measured)}, "
        message += f"and '{service.use.name}' has them of {' x '.join(given)}"
        hint = f"measure it again with 'dodo rig measure {rig.name} --camera', or take pictures of the measured size"
        yield Diagnostic(where.value.span if where else service.use.span, "camera-size", message, hint)


def _span(service: ResolvedService, argument: Argument) -> Span:
    return argument.entry.value.span if argument.entry else service.use.span
