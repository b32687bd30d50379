"""``rig-pool``: any rig of a pool can run the test: there are some, of one kind, and they can be told apart."""

from collections.abc import Iterator

from dodo_dsl.check.context import RuleContext
from dodo_dsl.diagnostics import Diagnostic, did_you_mean
from dodo_dsl.source import Scalar
from dodo_dsl.spec.deployment.rig import CAMERA_SOURCE, EMULATED_RIGS, KIND_TAGS, PORT, Rig
from dodo_dsl.spec.instances.pools import members


def check(context: RuleContext) -> Iterator[Diagnostic]:
    pool, rigs = context.spec.pool, context.deployment.rigs
    if pool is None:
        return
    if pool.kind:
        yield from _kind(pool.kind, rigs)
    for word in pool.names:
        if word.text in EMULATED_RIGS:
            message = f"'{word.text}' is in no pool, as every test has one of its own"
            yield Diagnostic(word.span, "rig-pool", message, f"write 'rig: {word.text}'")
        elif word.text not in rigs:
            yield Diagnostic(word.span, "unknown-rig", f"unknown rig '{word.text}'", did_you_mean(word.text, rigs))
    found = members(pool, rigs)
    places = {word.text: word.span for word in pool.names}
    for number, rig in enumerate(found):
        span = places.get(rig.name, pool.kind.span if pool.kind else context.spec.span("rig"))
        if rig.kind != found[0].kind:
            message = f"rig '{rig.name}' is {rig.kind}, and '{found[0].name}' is {found[0].kind}"
            yield Diagnostic(span, "rig-pool", message, "rigs of one kind can take each other's place")
        for other in found[:number]:
            if device := _same_device(other, rig):
                message = (
                    f"rigs '{other.name}' and '{rig.name}' both have '{device}', so it is unknown which one is there"
                )
                hint = "name ports by their serial numbers, as /dev/serial/by-id/... does"
                yield Diagnostic(span, "rig-pool", message, hint)


def _kind(word: Scalar, rigs: dict[str, Rig]) -> Iterator[Diagnostic]:
    if word.text in rigs:
        hint = f"write 'rig: {word.text}', or a list: [{', '.join(rigs)}]"
        yield Diagnostic(word.span, "rig-pool", f"'{word.text}' is a rig, expected a kind", hint)
    elif word.text not in KIND_TAGS:
        hint = did_you_mean(word.text.removeprefix("hil-"), KIND_TAGS)
        yield Diagnostic(word.span, "rig-pool", f"'{word.text}' is no kind of rig", hint)
    elif all(rig.kind != word.text for rig in rigs.values()):
        said = ", ".join(f"'{rig.name}' ({rig.kind})" for rig in rigs.values())
        message = f"dodo.yml has no rig of kind '{word.text}'"
        yield Diagnostic(word.span, "rig-pool", message, f"it has {said}" if said else "add it under 'rigs'")


def _same_device(one: Rig, other: Rig) -> str:
    """What tells rigs apart, where both have the same: the port, or the camera of rigs without one."""
    own = one.text(PORT) or one.text(CAMERA_SOURCE)
    return own if own == (other.text(PORT) or other.text(CAMERA_SOURCE)) else ""
