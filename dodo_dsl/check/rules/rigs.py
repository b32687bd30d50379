"""``rig-level``: hil tests name their rig, others have none; ``unknown-rig``: the deployment has the rig.

``rig-isolation``: hardware is on the host's network. ``rig-device``: a test moves the rig that it names and no other,
and only the service that moves it opens its port.
"""

import os
from collections.abc import Iterator

from dodo_dsl.check.context import RuleContext
from dodo_dsl.diagnostics import Diagnostic, did_you_mean
from dodo_dsl.spec.arguments import Argument
from dodo_dsl.spec.deployment.rig import EMULATED, EMULATED_RIGS, MEMORY, PORT, is_simulated
from dodo_dsl.spec.model import Use


def check(context: RuleContext) -> Iterator[Diagnostic]:
    yield from _devices(context)
    spec = context.spec
    if spec.level == "hil" and "rig" not in spec.spans:
        message = "a hil test needs a rig to run on"
        yield Diagnostic(spec.span("level"), "rig-level", message, "write 'rig: emulated', or a rig of dodo.yml")
    if spec.level in ("sil", "dil") and (spec.rig or spec.pool):
        message = f"a {spec.level} test runs without a rig"
        yield Diagnostic(spec.span("rig"), "rig-level", message, "remove it, or use level hil")
    if spec.rig is None:
        return
    rig = context.rig
    if rig is None:
        hint = did_you_mean(spec.rig, [*EMULATED_RIGS, *context.deployment.rigs])
        yield Diagnostic(spec.span("rig"), "unknown-rig", f"unknown rig '{spec.rig}'", hint)
    elif not rig.is_emulated and spec.isolation == "network":
        message = f"rig '{rig.name}' is reached through the host, so a test on it cannot have a network of its own"
        hint = "remove 'isolation'" if "isolation" in spec.spans else "run it without --isolation"
        yield Diagnostic(spec.span("isolation"), "rig-isolation", message, hint)


def _devices(context: RuleContext) -> Iterator[Diagnostic]:
    """Ports that are not the rig's: nothing would lease or check them, or ask the machine's operator."""
    rig = context.rig
    for service in context.services:
        for argument in service.arguments.values():
            if argument.parameter.rig != PORT:
                yield from _strangers(context, service.use, argument)
                yield from _memory(service.use, argument)
                continue
            port = argument.value.text if argument.value else EMULATED
            if is_simulated(port) or (rig is not None and port == rig.text(PORT)):
                continue
            span = argument.entry.value.span if argument.entry else service.use.span
            owner = f"rig '{rig.name}' does not have it" if rig else "the test runs on no rig"
            message = f"'{service.use.name}' would move what is at '{port}', and {owner}"
            yield Diagnostic(span, "rig-device", message, "name the rig of dodo.yml that has the port with 'rig'")


def _memory(use: Use, argument: Argument) -> Iterator[Diagnostic]:
    """Limits that a test writes itself: each test would write the rig's memory, and the next one would not fit."""
    if argument.parameter.rig == MEMORY and argument.parameter.name in use.parameters:
        message = f"'{use.name}' would write limits into the rig's memory, which are those of dodo.yml"
        hint = "write them in 'limits' of the rig in dodo.yml, or use parameters such as max-speed"
        yield Diagnostic(use.parameters[argument.parameter.name].key, "rig-device", message, hint)


def _strangers(context: RuleContext, use: Use, argument: Argument) -> Iterator[Diagnostic]:
    """Ports of rigs in other parameters: their services do not move the rig, and may not open its port."""
    written = argument.text or ""
    if argument.entry is None or not written.startswith(("/", "socket:")):
        return
    names = {written, os.path.realpath(written)}
    for rig in context.deployment.rigs.values():
        port = rig.text(PORT)
        if port and not names.isdisjoint({port, os.path.realpath(port)}):
            message = f"'{use.name}' would open '{written}', the port of rig '{rig.name}'"
            hint = "only the service that moves the rig opens its port; name another device"
            yield Diagnostic(argument.entry.value.span, "rig-device", message, hint)
