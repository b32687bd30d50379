"""Rules on a test itself: its names, its level and clock, its rig, and its goals."""

import os
from collections.abc import Iterator, Sequence
from fnmatch import fnmatchcase

from dodo_dsl.application.model import ApplicationSource
from dodo_dsl.check.resolve import ResolvedTest, RuleContext, isolation
from dodo_dsl.check.wiring import rates, rates_fit, step_hz
from dodo_dsl.diagnostics import Diagnostic, Span, did_you_mean, shown_path
from dodo_dsl.source import Entry, Mapping, Scalar, plain
from dodo_dsl.spec.arguments import Argument
from dodo_dsl.spec.deployment import RESERVED_CIDS, Deployment
from dodo_dsl.spec.model import Goal, Use
from dodo_dsl.spec.quantity import SHARE, QuantityError, convert
from dodo_dsl.spec.registry import KEYWORDS, SUFFIX, is_free, is_name
from dodo_dsl.spec.rig import EMULATED, EMULATED_RIGS, KIND_TAGS, MEMORY, PORT, is_simulated


def check_names(context: RuleContext) -> Iterator[Diagnostic]:
    spec = context.spec
    if spec.name is None:
        return
    if spec.name in KEYWORDS:
        message = f"'{spec.name}' is a keyword of GitLab's pipelines and cannot name a job"
        yield Diagnostic(spec.span("name"), "name-reserved", message, "choose another name, also for the file")
    elif spec.name != spec.location.stem and is_name(spec.name):  # the schema shows what is wrong with any other
        message, stem = f"the name '{spec.name}' differs from the file's name", spec.location.stem
        written = f"write 'name: {stem}', or " if is_free(stem) else ""
        hint = f"{written}rename the file to {spec.name}{SUFFIX}"
        yield Diagnostic(spec.span("name"), "name-differs", message, hint)
    others = [other for other in context.by_name[spec.name] if other.path != spec.path]
    if others:
        message = f"the name '{spec.name}' is taken by {shown_path(str(others[0].path))}"
        yield Diagnostic(spec.span("name"), "name-taken", message, "names are unique across all registries")


def check_levels(context: RuleContext) -> Iterator[Diagnostic]:
    spec = context.spec
    if spec.level == "dil" and spec.kind == "closed-loop":
        message = "a dil test cannot be closed-loop: a recording does not react to what the application does"
        yield Diagnostic(
            spec.span("kind"), "level-kind", message, "use kind open-loop or perception, or level sil or hil"
        )
    if spec.level == "hil" and spec.is_stepped:
        message = "a hil test cannot run in lockstep: hardware does not wait"
        yield Diagnostic(spec.span("clock"), "clock-level", message, "use clock realtime")


def check_clock_rates(context: RuleContext) -> Iterator[Diagnostic]:
    if not context.spec.is_stepped or not context.spec.is_whole:
        return
    known = rates(context.services)
    step = step_hz(context.wiring, known)
    for use in context.spec.uses:
        rate = known.get(use.name)
        if rate is None or rates_fit(rate, step):
            continue
        written = use.parameters.get("freq")
        message = (
            f"'{use.name}' has {rate:g} Hz, not a whole multiple or fraction of the {step:g} Hz of the test's frames"
        )
        hint = f"in lockstep a step takes {1000 / step:g} ms; use for example {_near(rate, step):g} Hz"
        yield Diagnostic(written.key if written else use.span, "clock-rate", message, hint)


def _near(rate: float, step: float) -> float:
    return step * round(rate / step) if rate > step else step / round(step / rate)


def check_rigs(context: RuleContext) -> Iterator[Diagnostic]:
    yield from _devices(context)
    spec = context.spec
    if spec.level == "hil" and "rig" not in spec.spans:
        message = "a hil test needs a rig to run on"
        hint = "write the kind of the rig, such as 'rig: dynamic', or the name of one in dodo.yml"
        yield Diagnostic(spec.span("level"), "rig-level", message, hint)
    if spec.level in ("sil", "dil") and spec.rig:
        message = f"a {spec.level} test runs without a rig"
        yield Diagnostic(spec.span("rig"), "rig-level", message, "remove it, or use level hil")
    if spec.rig is None:
        return
    rig = context.rig
    if rig is None:
        hint = did_you_mean(spec.rig, [*EMULATED_RIGS, *KIND_TAGS, *context.deployment.rigs])
        yield Diagnostic(spec.span("rig"), "unknown-rig", f"unknown rig '{spec.rig}'", hint)
    elif not rig.is_emulated and spec.isolation == "network":
        message = f"rig '{rig.name}' is reached through the host, so a test on it cannot have its own network"
        hint = "remove 'isolation'" if "isolation" in spec.spans else "run it without --isolation"
        yield Diagnostic(spec.span("isolation"), "rig-isolation", message, hint)


def check_built_in_cid(context: RuleContext) -> Iterator[Diagnostic]:
    """A built-in CID on the host's network, where real cars may listen, or on a rig with another one."""
    if context.application is None or context.application.cid is None:
        return
    declared, rig = context.application.cids[0], context.rig
    cid = context.application.cid
    if rig is not None and rig.cid not in (None, cid):
        message = f"the application has the CID {cid} built in, and rig '{rig.name}' has {rig.cid}"
        yield Diagnostic(declared.span, "application-cid", message, "let the program take it from a flag: --cid=111")
    elif cid in RESERVED_CIDS and isolation(context.spec, rig) == "host":
        message = (
            f"the application has the CID {cid} built in, which real cars use, and the test is on the host's network"
        )
        hint = "give the test its own network, or let the program take the CID from a flag: --cid=111"
        yield Diagnostic(declared.span, "application-cid", message, hint)


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


def check_until(context: RuleContext) -> Iterator[Diagnostic]:
    name, evaluators = context.spec.until, [use.name for use in context.spec.uses if use.layer == "evaluation"]
    if name and name not in evaluators and context.spec.is_whole:
        message = f"the test has no evaluator '{name}'"
        yield Diagnostic(context.spec.span("until"), "unknown-name", message, did_you_mean(name, evaluators))


def check_goals(context: RuleContext) -> Iterator[Diagnostic]:
    test, headline = context.test, context.test.spec.headline
    yield from resolved_goals(test)[1]
    if headline and test.is_complete and _unit(test, headline) is None:
        yield _unknown_check(test, headline, test.spec.span("headline"))


def _unknown_check(test: ResolvedTest, name: str, span: Span) -> Diagnostic:
    hint = did_you_mean(name, _units(test))
    return Diagnostic(span, "unknown-name", f"no evaluator of the test has a check '{name}'", hint)


_OF_THE_TEST = {
    "slow-answers": "",
    "uncopied-sample-times": "",
    "peak-memory-*": "MB",
    "processor-time-*": "s",
    "processor-share-*": "",
}
"""Checks of no evaluator."""


def resolved_goals(test: ResolvedTest) -> tuple[tuple[Goal, ...], tuple[Diagnostic, ...]]:
    """The goals of a test that can be understood, as they are ordered there, and what is wrong with the others."""
    found = [_goal(test, name, entry) for name, entry in test.spec.goals.items()]
    goals = tuple(goal for goal in found if isinstance(goal, Goal))
    return goals, tuple(problem for problem in found if isinstance(problem, Diagnostic))


def _goal(test: ResolvedTest, name: str, entry: Entry) -> Goal | Diagnostic | None:
    """A goal or its problem; None if a key is not valid, or a service that is not known may have the check."""
    unit, written = _unit(test, name), plain(entry.value)
    if unit is None and test.is_complete:
        return _unknown_check(test, name, entry.key)
    if unit is None or not {"better", "zero", "one"} <= written.keys():
        return None
    scalars = {k: e.value for k, e in entry.value.entries.items()} if isinstance(entry.value, Mapping) else {}
    values = {}
    for key in ("zero", "one"):
        scalar = scalars[key]
        assert isinstance(scalar, Scalar)
        try:
            values[key] = float(convert(scalar.text, unit or SHARE))
        except QuantityError as error:
            return Diagnostic(scalar.span, "wrong-unit", f"'{key}': {error}", error.hint)
    better = written["better"]
    if not (values["one"] < values["zero"] if better == "less" else values["one"] > values["zero"]):
        message = f"'one' is {written['one']}, expected {better} than 'zero', as {better} is better"
        return Diagnostic(scalars["one"].span, "out-of-range", message)
    return Goal(name, **values, weight=float(written.get("weight", 1)))


def _units(test: ResolvedTest) -> dict[str, str]:
    found = dict(_OF_THE_TEST)
    for service in test.services:
        found.update(service.manifest.checks)
    return found


def _unit(test: ResolvedTest, name: str) -> str | None:
    """The unit of a check, None if no manifest has it."""
    return next((unit for pattern, unit in _units(test).items() if fnmatchcase(name, pattern)), None)


def check_suite(
    tests: Sequence[ResolvedTest], deployment: Deployment, application: ApplicationSource | None
) -> Iterator[Diagnostic]:
    """Rules on all tests together, whatever else is wrong with some of them.

    ``out-of-cids``: no two on the host's network share a CID. ``out-of-range``: the deployment's network has room.
    """
    file = Span(str(deployment.file)) if deployment.file else None
    free = [isolation(test.spec, test.rig) for test in tests if reserved_cid(test, application) is None]
    if len(free) > len(deployment.cids) <= free.count("host"):
        message = f"{free.count('host')} tests on the host network, but only {len(deployment.cids)} CIDs"
        last = max(tests, key=lambda test: test.spec.slug)
        yield Diagnostic(file or last.spec.span("name"), "out-of-cids", message, "widen 'cids' in dodo.yml")
    isolated = [test for test in tests if isolation(test.spec, test.rig) == "network"]
    needed = {containers(test, application): test for test in isolated}
    if needed and (length := prefix(most := max(needed))) < deployment.subnets.prefixlen:
        message = f"a test has {most} containers and so needs a /{length}, but 'subnets' is {deployment.subnets}"
        hint = "give 'subnets' in dodo.yml more, such as 10.213.0.0/16"
        yield Diagnostic(file or needed[most].spec.span("name"), "out-of-range", message, hint)


def reserved_cid(test: ResolvedTest, application: ApplicationSource | None) -> int | None:
    if test.rig and test.rig.cid is not None:
        return test.rig.cid
    return application.cid if application else None


def containers(test: ResolvedTest, application: ApplicationSource | None) -> int:
    """Those of a test: each service, the recorder, in lockstep the clock, and the one that holds the network."""
    own = len(application.services) if application else 0
    return len(test.spec.uses) + own + (3 if test.spec.is_stepped else 2)


SMALLEST = 28
"""The prefix of the smallest subnet of a test, with room for 13 containers."""
_TAKEN = 3
"""Addresses of a subnet that no container gets: the network's, the engine's own, and that of broadcasts."""


def prefix(containers: int) -> int:
    """The length of the prefix of the smallest subnet in which each container has an address."""
    return min(SMALLEST, 32 - (containers + _TAKEN - 1).bit_length())
