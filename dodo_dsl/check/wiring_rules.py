"""Rules on what services and application give one another: messages, shared memories, and the test's variables."""

from collections.abc import Collection, Iterator
from dataclasses import replace

from dodo_dsl.application import opendlv_flags, secret_variables
from dodo_dsl.application.container import is_carried
from dodo_dsl.application.interpolation import RequiredVariable, interpolate
from dodo_dsl.application.model import ApplicationSource, ComposeService, image_variable
from dodo_dsl.application.opendlv_flags import CID_VARIABLES
from dodo_dsl.application.variables import owner, split_by, with_variables
from dodo_dsl.check import ros_topics
from dodo_dsl.check.resolve import RuleContext
from dodo_dsl.check.senders import HIDDEN, told
from dodo_dsl.check.wiring import ANYTHING, End, Wiring, message
from dodo_dsl.diagnostics import Diagnostic, Severity, Span, did_you_mean
from dodo_dsl.opendlv.address import is_of_the_world
from dodo_dsl.opendlv.ros_types import SENT
from dodo_dsl.source import Scalar
from dodo_dsl.spec.manifest import Manifest

SENSORS = "opendlv.proxy."
"""Prefix of the messages that a car's devices send."""


def check_producers(context: RuleContext) -> Iterator[Diagnostic]:
    if not context.test.is_complete:
        return  # unknown services and wrong layers come first
    wiring = context.wiring
    known = {*context.messages, ANYTHING}
    for end in wiring.consumed:
        if end.port.optional or (end.port.kind == "message" and end.port.name not in known):
            continue  # an unknown message is reported where it is written
        if not (wiring.application_may_produce(end.port) or wiring.producers(end.port)):
            yield _unsatisfied(context, wiring, end)
    yield from _twice(wiring)
    yield from _judged(wiring)
    yield from _unsatisfied_application(context, wiring)


def check_topics(context: RuleContext) -> Iterator[Diagnostic]:
    if not context.test.is_complete:
        return
    for each in context.wiring.topics:
        for name in each.bus if each.written.given and not each.is_picture else ():
            if is_of_the_world(name) or context.wiring.judges_by(message(name, 0)):
                what = f"'{each.written.topic.topic}' is made of {name}, which only a simulation has"
                yield Diagnostic(each.written.span, "ros-topic", what, "it is in no topic: remove it")
    yield from ros_topics.problems(context.wiring.topics)


def check_hidden_messages(context: RuleContext) -> Iterator[Diagnostic]:
    """``true-pose``: the application takes what only a simulation knows, and the test hides that."""
    if context.spec.pose != HIDDEN:
        return
    name = context.spec.name or context.spec.location.stem
    for end in told(context.wiring):
        message = f"the application's '{end.service}' takes {end.port}, which only a simulation has: '{name}' hides it"
        hint = "take it out of x-dodo.in, or write 'pose: declared' in your own test"
        yield Diagnostic(end.span, "true-pose", message, hint)


def _unsatisfied(context: RuleContext, wiring: Wiring, end: End) -> Diagnostic:
    rule = "no-sample" if end.layer == "evaluation" else "no-producer"
    what = f"{end.port.kind} {end.port}" if end.port.kind == "memory" else str(end.port)
    if end.port.can_be_required:
        message = f"'{end.service}' needs {what}, which no service of the test or the application sends"
        others = [each.port.name for each in wiring.alternatives if each.service == end.service]
        what = ", or ".join(["list it", *(f"{other} instead" for other in others)]) + "," * bool(others)
        hint = f"{what} under x-dodo.out of the application's service that sends it, or x-dodo.lines if that prints it"
        types = [name for name, messages in SENT.items() if {end.port.name, *others}.intersection(messages)]
        if wiring.topics and types:
            hint = f"a topic of type {' or '.join(types)} under ros.out of the node becomes it"
    else:
        message = f"'{end.service}' needs {what}, which no service of the test sends"
        hint = _who_could(context, wiring, end)
    if rule == "no-sample":
        message += ", so it could never judge"
    return Diagnostic(end.span, rule, message, hint)


def _who_could(context: RuleContext, wiring: Wiring, end: End) -> str:
    stamps = sorted(str(e.port) for e in wiring.produced if e.port.name == end.port.name)
    if stamps:
        return f"the test sends {' and '.join(stamps)}"
    names = sorted(m.name for m in context.manifests.values() if _sends(m, end.port.name))
    return f"add a service that sends it: {', '.join(names)}" if names else ""


def _sends(manifest: Manifest, name: str) -> bool:
    return any(name in _names_of(manifest, port) for port in manifest.all_messages.outputs)


def _names_of(manifest: Manifest, port: str) -> tuple[str, ...]:
    """The messages that a port may be: one, or those that its parameter may choose."""
    name = port.partition("/")[0]
    parameter = manifest.parameters.get(name.strip("{}")) if name.startswith("{") else None
    return parameter.choices if parameter else (name,)


def _twice(wiring: Wiring) -> Iterator[Diagnostic]:
    first: dict[tuple[str, str, int | None], End] = {}
    for end in (*wiring.produced, *wiring.application_produces):
        if end.port.name == ANYTHING:
            continue
        key = (end.port.kind, end.port.name, end.port.stamp)
        other = first.setdefault(key, end)
        if other is not end and "application" not in (other.layer,):
            who = f"the application's '{end.service}'" if end.layer == "application" else f"'{end.service}'"
            does, what = ("send", "sender stamp") if end.port.kind == "message" else ("write the memory", "name")
            message = f"'{other.service}' and {who} both {does} {end.port}"
            hint = f"give one of them another {what}"
            yield Diagnostic(end.span, "two-producers", message, hint)


def _judged(wiring: Wiring) -> Iterator[Diagnostic]:
    """What the application prints and is judged by, under any stamp: the same as a second producer."""
    for end in wiring.printed:
        judge = wiring.judges_by(end.port)
        if judge and all(other.port != end.port for other in wiring.produced):
            message = f"the application's '{end.service}' prints {end.port}, by which '{judge}' judges it"
            yield Diagnostic(end.span, "two-producers", message, "name another message, or another sender")


def _unsatisfied_application(context: RuleContext, wiring: Wiring) -> Iterator[Diagnostic]:
    for end in wiring.application_consumes:
        own = any(end.port.consumes(other.port) for other in wiring.application_produces)
        if not own and not wiring.producers(end.port) and not wiring.undeclared:
            message = f"the application's '{end.service}' consumes {end.port}, which no service of the test sends"
            hint = _who_could(context, wiring, end) if end.port.name.startswith(SENSORS) else ""
            yield Diagnostic(end.span, "application-input", message, hint, severity="warning")


Asked = dict[str, Span]
"""Memories by name, with where they are written."""


def check_memories(context: RuleContext) -> Iterator[Diagnostic]:
    """A service that reads one memory of the test may make others, and so may services that share one."""
    made = {end.port.name for end in context.wiring.produced if end.port.kind == "memory"}
    if not made or context.application is None or not context.test.is_complete:
        return
    services = with_variables(context.application, context.test.variables).services.values()
    asked = {service.name: _asked(service) for service in services}
    for asking, names in asked.items():
        others = {name for other, own in asked.items() if other != asking for name in own}
        for name, span in names.items() if made.isdisjoint(names) and others.isdisjoint(names) else ():
            message = f"the application's '{asking}' asks for the memory '{name}', which no service of the test makes"
            yield Diagnostic(span, "application-memory", message, did_you_mean(name, made), "warning")


def readers(application: ApplicationSource, names: Collection[str]) -> list[str]:
    services = application.services.values()
    return [each.name for each in services if not set(names).isdisjoint(_asked(each))]


def _asked(service: ComposeService) -> Asked:
    found: Asked = {}
    for word, item in service.words:
        names = opendlv_flags.memories([word])
        found.update((name, item.span) for name in names if "$" not in name)
    return found


_RULE = "application-variable"
_FOR_ALL = ("command", "environment", "env_file")
"""Keys whose variables processes need, too."""
_GIVEN = ("command", "entrypoint", "environment")
"""Keys whose variables a test may set."""


_HARDWARE = ("cap_add", "devices", "privileged", "security_opt")
"""Keys that only rigs carry."""


def check_variables(context: RuleContext) -> Iterator[Diagnostic]:
    if context.application:
        yield from _required(context, context.application)
    for name, entry in context.spec.variables.items():
        if why := owner(name):
            message = f"a test cannot set '{name}': {why}"
            yield Diagnostic(entry.key, _RULE, message, "set a variable that the application itself reads")
        elif isinstance(entry.value, Scalar):
            yield from _value(context, name, entry.value)
            if kind := secret_variables.secret_kind(entry.value.text):
                message = f"this looks like {kind}, which everybody with access to the repository can read"
                hint = "keep it out of the repository, and pass a variable with 'environment' of dodo.yml"
                span = replace(entry.value.span, length=0)
                yield Diagnostic(span, "application-secret", message, hint, "warning")


def _value(context: RuleContext, name: str, value: Scalar) -> Iterator[Diagnostic]:
    if not value.text.isprintable():
        yield Diagnostic(value.span, _RULE, f"the value of '{name}' has control characters, expected one line of text")
    elif context.application and (service := split_by(context.application, name, value.text)):
        message = f"the value of '{name}' has quotation marks or the like, at which the command of '{service}' is split"
        yield Diagnostic(value.span, _RULE, message, f"write the command of '{service}' as a list")


def _required(context: RuleContext, application: ApplicationSource) -> Iterator[Diagnostic]:
    in_containers = any(s.node.get("x-dodo-process") is None for s in application.services.values())
    given = context.test.variables
    maybe = {**dict.fromkeys((*CID_VARIABLES, *application.access.passed), "?"), **application.known}
    for service, key, part in application.demanding:
        is_rig = context.rig is not None and not context.rig.is_emulated
        if service and (not is_carried(key) or (key in _HARDWARE and not is_rig)):
            continue
        if key == "image" and image_variable(service) in application.known:
            continue
        try:
            interpolate(part.text, {**maybe, **given} if service and key in _GIVEN else maybe)
        except RequiredVariable as problem:
            is_sure = key in _FOR_ALL or (in_containers and key != "image")
            severity: Severity = "error" if is_sure else "warning"
            ways = [f"set it in .env beside this file, or pass it with environment: [{problem.name}] in dodo.yml"]
            ways += [f"or in the test with application: {{env: {{{problem.name}: ...}}}}"] if key in _GIVEN else []
            ways += [f"or let a pipeline set {image_variable(service)}"] if key == "image" else []
            message = f"variable '{problem.name}' has no value: {problem.why}"
            yield Diagnostic(part.span, "application-required", message, ", ".join(ways), severity)
