"""``camera-source``: what a rig's computer can take pictures from, and in which sizes."""

from collections.abc import Iterator
from pathlib import PurePath

from dodo_dsl.check.context import RuleContext
from dodo_dsl.diagnostics import Diagnostic, Span, did_you_mean
from dodo_dsl.spec.arguments import Argument, ResolvedService
from dodo_dsl.spec.deployment.rig import CAMERA_SOURCE, EMULATED, RPICAM

_NAMES = (RPICAM, "file", EMULATED)
_ALIGNED = 64
"""Rows of other widths are padded in the pipe of ``rpicam-vid``."""


def check(context: RuleContext) -> Iterator[Diagnostic]:
    for service in context.services:
        for argument in service.arguments.values():
            if argument.parameter.rig == CAMERA_SOURCE and argument.text:
                yield from _problems(context, service, argument)


def _problems(context: RuleContext, service: ResolvedService, argument: Argument) -> Iterator[Diagnostic]:
    source, span = argument.text or "", _span(service, argument)
    if source not in _NAMES and not source.startswith("/dev/") and not PurePath(source).suffix:
        hint = did_you_mean(source, list(_NAMES)) or "write a device such as /dev/video0, rpicam or file"
        yield Diagnostic(span, "camera-source", f"'{source}' is not a source of pictures", hint)
    elif source == EMULATED and context.rig is not None and not context.rig.is_emulated:
        message = f"rig '{context.rig.name}' is hardware, and an emulated camera sees nothing of it"
        yield Diagnostic(span, "camera-source", message, "write a device such as /dev/video0, or rpicam")
    elif source == RPICAM and (width := service.texts.get("width", "")).isdigit() and int(width) % _ALIGNED:
        message = f"rpicam-vid gives pictures whose width is a multiple of {_ALIGNED}, not {width}"
        hint = f"write a width of {max(int(width) // _ALIGNED, 1) * _ALIGNED}"
        yield Diagnostic(span, "camera-source", message, hint)


def _span(service: ResolvedService, argument: Argument) -> Span:
    return argument.entry.value.span if argument.entry else service.use.span
