"""``rig: {any: dynamic}``: a test that any rig of a kind, or any of some, may run; an instance for each of them."""

from collections.abc import Mapping as Known
from dataclasses import replace

from dodo_dsl.source import Scalar
from dodo_dsl.spec.deployment.rig import Rig
from dodo_dsl.spec.instances.matrix import Choice
from dodo_dsl.spec.model import Spec
from dodo_dsl.spec.pool import Pool

DIMENSION = "rig"


def members(pool: Pool, rigs: Known[str, Rig]) -> list[Rig]:
    """The rigs of a pool that the deployment has, in the order in which they are written there or in the test."""
    if pool.kind:
        return [rig for rig in rigs.values() if rig.kind == pool.kind.text]
    return [rigs[name] for name in dict.fromkeys(word.text for word in pool.names) if name in rigs]


def on_each(spec: Spec, rigs: Known[str, Rig]) -> list[Spec]:
    """A spec with a pool on each of its rigs, any other as it is; rigs of another kind than the first are mistakes."""
    found = members(spec.pool, rigs) if spec.pool else []
    return [_on(spec, rig) for rig in found if rig.kind == found[0].kind] or [spec]


def of_test(spec: Spec) -> Spec:
    """The spec under the name that its test has whichever rig of its pool runs it."""
    if not spec.pool:
        return spec
    values = list(spec.choice.values)
    place = max(n for n, (name, _) in enumerate(values) if name == DIMENSION)  # a matrix may have one of that name, too
    return replace(spec, choice=replace(spec.choice, values=(*values[:place], *values[place + 1 :])))


def _on(spec: Spec, rig: Rig) -> Spec:
    name = Scalar(spec.span(DIMENSION), rig.name, rig.name)
    corners = tuple(_on(corner, rig) for corner in spec.corners)
    choice = Choice((*spec.choice.values, (DIMENSION, name)))
    return replace(spec, rig=rig.name, choice=choice, corners=corners)
