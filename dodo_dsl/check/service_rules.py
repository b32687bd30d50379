"""Rules on the services of a test: their names and layers, parameters, messages and cameras."""

import re
from collections.abc import Collection, Iterator
from collections.abc import Sequence as Several
from pathlib import Path

from dodo_dsl.application.model import PrintedLine
from dodo_dsl.check import resolve
from dodo_dsl.check.resolve import RuleContext
from dodo_dsl.check.senders import is_shipped, told
from dodo_dsl.diagnostics import Diagnostic, Span, did_you_mean
from dodo_dsl.opendlv.address import is_of_the_world
from dodo_dsl.source import MAX_PROBLEMS, Entry, Mapping, Scalar, Sequence, read, walk
from dodo_dsl.spec.arguments import FRAME, Argument, ResolvedService
from dodo_dsl.spec.manifest import holds
from dodo_dsl.spec.slips import unknown_key


def check_services(context: RuleContext) -> Iterator[Diagnostic]:
    first_layer: dict[str, str] = {}
    for use in context.spec.uses:
        if manifest := context.manifests.get(use.uses.text):
            if use.layer not in manifest.layers:
                message = f"service '{manifest.name}' does not fit layer {use.layer}"
                yield Diagnostic(use.uses.span, "wrong-layer", message, f"move it to {' or '.join(manifest.layers)}")
        else:
            hint = did_you_mean(use.uses.text, context.manifests) or "'dodo list --services' shows those that there are"
            message = f"unknown service '{use.uses.text}'"
            yield Diagnostic(use.uses.span, "unknown-service", message, hint)
        if use.name == "sandbox" or use.name.startswith("dodo-"):
            message = f"the name '{use.name}' is reserved for DoDo's own services"
            hint = "choose another name; 'sandbox' and 'dodo-...' are reserved"
            yield Diagnostic(use.span, "name-reserved", message, hint)
        if use.name in first_layer:
            message = f"the name '{use.name}' is already used in layer {first_layer[use.name]}"
            yield Diagnostic(use.span, "name-taken", message, "the names of a test's services are unique")
        first_layer.setdefault(use.name, use.layer)
        if context.application and use.name in context.application.services:
            message = f"the application also has a service '{use.name}'"
            yield Diagnostic(use.span, "name-taken", message, "rename the one in the test")


def check_parameters(context: RuleContext) -> Iterator[Diagnostic]:
    for number, service in enumerate(context.services):
        yield from _written(service)
        for name, argument in service.arguments.items():
            if argument.problem and name not in service.use.parameters:  # of the rig or of another service
                yield argument.problem
        yield from _missing(context, service, context.services[:number])
        yield from _counts(service)


def _counts(service: ResolvedService) -> Iterator[Diagnostic]:
    """Lists that have neither one item nor one for each item of the list that they belong to."""
    counts = {name: len(text.split(",")) for name, text in service.texts.items()}
    for name, argument in service.arguments.items():
        per = argument.parameter.per
        if argument.entry and per in counts and counts.get(name, 1) not in (1, counts[per]):
            message = f"parameter '{name}' has {counts[name]} items, expected one, or {counts[per]} as '{per}' has"
            yield Diagnostic(argument.entry.value.span, "wrong-value", message)


def _written(service: ResolvedService) -> Iterator[Diagnostic]:
    for name, entry in service.use.parameters.items():
        argument = service.arguments.get(name)
        if argument is None:
            known = service.manifest.parameters
            slip, hint = unknown_key(name, known)
            message = slip or f"service '{service.manifest.name}' has no parameter '{name}'"
            yield Diagnostic(entry.key, "unknown-parameter", message, hint)
        elif argument.problem:
            yield argument.problem
        elif not holds(argument.parameter.when, service.texts):
            yield _without_effect(service, argument, entry)
        elif argument.parameter.deprecated:
            message = f"parameter '{name}' is deprecated: {argument.parameter.deprecated}"
            yield Diagnostic(entry.key, "unused-parameter", message, "remove it", "warning")


def _without_effect(service: ResolvedService, argument: Argument, entry: Entry) -> Diagnostic:
    name, when = argument.parameter.name, argument.parameter.when
    other = next(other for other, values in when.items() if service.texts.get(other, "") not in values)
    wanted = f"'{other}: {' or '.join(filter(None, when[other]))}'"
    instead = (
        f"this service has '{other}: {service.texts[other]}'" if other in service.texts else f"'{other}' is not given"
    )
    message = f"parameter '{name}' is for {wanted}, and {instead}"
    return Diagnostic(entry.key, "unused-parameter", message, f"remove it, or write {wanted}")


def _needs(service: ResolvedService, name: str) -> bool:
    parameter = service.manifest.parameters.get(name)
    return parameter is not None and parameter.required and name not in service.use.parameters


def _missing(context: RuleContext, service: ResolvedService, before: Several[ResolvedService]) -> Iterator[Diagnostic]:
    use, manifest, rig = service.use, service.manifest, context.rig
    for parameter in manifest.parameters.values():
        name = parameter.name
        is_on_rig = bool(context.spec.rig) or context.spec.level == "hil"
        if not _needs(service, name) or (parameter.rig and (rig.entry(parameter.rig) if rig else is_on_rig)):
            continue  # a rig that is unknown or missing may give it, too
        if parameter.shared and (not context.spec.is_whole or any(_needs(each, name) for each in before)):
            continue  # a service that could not be read may give it, or one that has this problem, too
        written = [other.parameters[name].value for other in context.spec.uses if name in other.parameters]
        others = {value.text for value in written if isinstance(value, Scalar)}
        if parameter.shared and written and len(others) < 2:
            continue
        message = f"service '{manifest.name}' needs parameter '{name}': {parameter.help}"
        hint = f"write '{name}: ...' under 'with'"
        if parameter.rig and rig:
            hint += f", or give the rig '{rig.name}' its '{parameter.rig}'"
        if parameter.shared and written:
            hint = f"other services have {', '.join(sorted(others))}, so write the one to use"
        yield Diagnostic(use.span, "missing-parameter", message, hint)


def check_messages(context: RuleContext) -> Iterator[Diagnostic]:
    for service in context.services:
        for name, entry in service.use.parameters.items():
            argument = service.arguments.get(name)
            if argument and argument.parameter.type == "message" and argument.value:
                yield from unknown_message(argument.value.text, context.messages, entry.value.span)
            if isinstance(entry.value, Sequence) and any(f"{{{name}}}" in p for p in service.messages.inputs):
                for item in entry.value.items[:MAX_PROBLEMS]:
                    if isinstance(item, Scalar):
                        yield from unknown_message(item.text.partition("/")[0], context.messages, item.span)
    declared = context.application.declared.values() if context.application else ()
    for own in declared:
        for name, span in (*own.inputs, *own.outputs, *own.answers) if own else ():
            yield from unknown_message(name.partition("/")[0], context.messages, span)
        yield from _lines(context, own.lines if own else ())


def check_own_messages(context: RuleContext) -> Iterator[Diagnostic]:
    """``wrong-messages``: the deployment gives a name or an id another meaning than services of DoDo's."""
    standard, known = resolve.known_messages(()), resolve.known_messages(context.deployment.messages)
    theirs = [each for each in known.values() if each != standard.get(each.name)]
    takes_old = resolve.takes_old_frames(context.wiring, context.deployment.messages)
    found: dict[str, Diagnostic] = {}
    for service, name, is_heard in _used(context) if theirs else ():
        ours = standard[name]
        sends_both = takes_old and name == FRAME and resolve.EULER in service.arguments
        for own in (each for each in theirs if name == each.name or ours.id == each.id):
            is_former = own.name.startswith("opendlv.") and own.name not in standard
            if own.name == name:
                is_right = own.fits(ours) or sends_both or not is_heard
                message = f"'{name}' is not as service '{service.manifest.name}' knows it"
            else:
                is_right = is_former and own.fits(ours)
                message = f"id {own.id} of '{own.name}' is that of {name}, which '{service.manifest.name}' uses"
            if not is_right:
                found.setdefault(own.name, Diagnostic(Span(*own.place), "wrong-messages", message, f"DoDo's is {ours}"))
    yield from found.values()


def _used(context: RuleContext) -> Iterator[tuple[ResolvedService, str, bool]]:
    """The standard messages that DoDo's services name themselves; whether the application hears or sends them."""
    wiring, standard = context.wiring, resolve.known_messages(())
    said = {end.port.name for end in told(wiring)}
    for service in filter(lambda each: is_shipped(each.manifest.process), context.services):
        named = {each.text for each in service.arguments.values() if each.parameter.type == "message"}
        for end in (*wiring.produced, *wiring.consumed):
            name = end.port.name
            if end.service == service.use.name and name in standard and name not in named:
                is_secret = wiring.judges_by(end.port) or wiring.is_truth(end.port)
                is_heard = end in wiring.produced and name in said if is_of_the_world(name) else not is_secret
                yield service, name, is_heard


def _lines(context: RuleContext, lines: Collection[PrintedLine]) -> Iterator[Diagnostic]:
    """What is wrong with lines that become messages; what reads patterns is loaded if there are any."""
    if lines:
        from dodo_dsl.application.printed_lines import line_problems

        for line in lines:
            yield from line_problems(line, resolve.known_messages(context.deployment.messages))


def unknown_message(name: str, known: Collection[str], span: Span) -> Iterator[Diagnostic]:
    if name and name not in known:
        hint = did_you_mean(name, known) or "add the files of your own messages under 'messages' in dodo.yml"
        yield Diagnostic(span, "unknown-message", f"unknown message '{name[:80]}'", hint)


_MESSAGE = re.compile(r"[\w.]+")


def unknown_messages(folders: tuple[Path, ...], known: Collection[str]) -> Iterator[Diagnostic]:
    """The messages that are not ``known`` in ``<folder>/<service>/service.yml``; a placeholder is for the test to name.

    Loading these files reports whatever else is wrong with them.
    """
    for folder in folders:
        for path in sorted(folder.glob("*/service.yml")):
            node, _ = read(path)
            ports = node.get("messages") if isinstance(node, Mapping) else None
            for scalar in walk(ports) if ports is not None else ():
                name = scalar.text.partition("/")[0].removesuffix("?") if isinstance(scalar, Scalar) else ""
                if _MESSAGE.fullmatch(name):
                    yield from unknown_message(name, known, scalar.span)


_OPTICS = "camera.intrinsics"


def check_cameras(context: RuleContext) -> Iterator[Diagnostic]:
    rig = context.rig
    for service in context.services if rig else ():
        assert rig is not None
        taken = (a.parameter for a in service.arguments.values() if (a.parameter.rig or "").startswith(_OPTICS))
        measured = [rig.text(f"{_OPTICS}.{name}") for name in ("width", "height")]
        given = [service.texts.get(name, "") for name in ("width", "height")]
        has_optics = any(p.name not in service.use.parameters and rig.entry(p.rig) for p in taken)
        if has_optics and all(measured) and all(given) and measured != given:
            where = service.use.parameters.get("width") or rig.entry(f"{_OPTICS}.width")
            message = f"the camera of rig '{rig.name}' was measured in frames of {' x '.join(measured)}, "
            message += f"and '{service.use.name}' has them of {' x '.join(given)}"
            hint = "measure it again, or take frames of the measured size"
            yield Diagnostic(where.value.span if where else service.use.span, "camera-size", message, hint)
