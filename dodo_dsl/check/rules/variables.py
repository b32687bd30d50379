"""Variables of the application: those that a test sets, and those that its compose file requires.

``application-variable``: a test sets only variables that are not DoDo's, to values that fit.
``application-required``: no variable that the file requires (``${NAME:?why}``) is certain to be without a value, as
compose would then refuse the test.
``application-secret``: no value that a test sets looks like a secret.
"""

from collections.abc import Iterator

from dodo_dsl.application.access import secret_problems
from dodo_dsl.application.access.compose_keys import SERVICE, removed
from dodo_dsl.application.interpolation import RequiredVariable, interpolate
from dodo_dsl.application.model import ApplicationSource
from dodo_dsl.application.opendlv_flags import CID_VARIABLES
from dodo_dsl.application.service_environment import image_variable
from dodo_dsl.application.test_variables import owner, split_by
from dodo_dsl.check.context import RuleContext
from dodo_dsl.diagnostics import Diagnostic, Severity
from dodo_dsl.source import Scalar

_RULE = "application-variable"
_FOR_ALL = ("command", "environment", "env_file")
"""Keys whose variables processes need, too."""
_GIVEN = ("command", "entrypoint", "environment")
"""Keys whose variables a test may set."""
_UNSURE = (
    "cap_add", "depends_on", "deploy", "device_cgroup_rules", "devices", "ipc", "logging", "name", "network_mode",
    "networks", "pid", "privileged", "security_opt", "volumes_from",
)  # fmt: skip
"""Keys of which a test's copy may not have what is written."""


def check(context: RuleContext) -> Iterator[Diagnostic]:
    if context.application:
        yield from _required(context, context.application)
    for name, entry in context.spec.variables.items():
        if why := owner(name):
            message = f"a test cannot set '{name}': {why}"
            yield Diagnostic(entry.key, _RULE, message, "set a variable that the application itself reads")
        elif isinstance(entry.value, Scalar):
            yield from _value(context, name, entry.value)
            yield from secret_problems.written([entry.value])


def _value(context: RuleContext, name: str, value: Scalar) -> Iterator[Diagnostic]:
    if not value.text.isprintable():
        yield Diagnostic(value.span, _RULE, f"the value of '{name}' has control characters, expected one line of text")
    elif context.application and (service := split_by(context.application, name, value.text)):
        message = f"the value of '{name}' has quotation marks or the like, at which the command of '{service}' is split"
        yield Diagnostic(value.span, _RULE, message, f"write the command of '{service}' as a list")


def _required(context: RuleContext, application: ApplicationSource) -> Iterator[Diagnostic]:
    in_containers = any(s.node.get("x-dodo-process") is None for s in application.services.values())
    given = {
        name: entry.value.text for name, entry in context.spec.variables.items() if isinstance(entry.value, Scalar)
    }
    maybe = {**dict.fromkeys((*CID_VARIABLES, *application.access.passed), "?"), **application.known}
    for service, key, part in application.demanding:
        if key.startswith("x-") or key in _UNSURE or (service and key in removed(SERVICE)):
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
