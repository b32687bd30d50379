"""Where the value of a service's parameter comes from, and what it is."""

from dodo_dsl.source import Entry
from dodo_dsl.spec.manifest import Manifest, Parameter
from dodo_dsl.spec.model import Spec, Use
from dodo_dsl.spec.rig import Rig
from dodo_dsl.spec.values import Value, ValueProblem, convert, default_value


def written(spec: Spec, use: Use, parameter: Parameter, rig: Rig | None) -> Entry | None:
    """What is written for a parameter: in its service, in another one that it is shared with, or in the rig."""
    own = use.parameters.get(parameter.name)
    if own is not None:
        return own
    if parameter.shared:
        for other in spec.uses:
            if other is not use and parameter.name in other.parameters:
                return other.parameters[parameter.name]
    return rig.entry(parameter.rig) if rig and parameter.rig else None


def value(spec: Spec, use: Use, parameter: Parameter, rig: Rig | None) -> Value | None:
    """The value as the flag carries it, the default included; raises ValueProblem for one that does not fit."""
    entry = written(spec, use, parameter, rig)
    return convert(parameter, entry.value, spec.location.root) if entry else default_value(parameter)


def texts(spec: Spec, use: Use, manifest: Manifest, rig: Rig | None) -> dict[str, str]:
    """The values of a service's parameters as texts; those that do not fit or are not given are missing."""
    found = {}
    for parameter in manifest.parameters.values():
        try:
            given = value(spec, use, parameter, rig)
        except ValueProblem:
            continue
        if given is not None:
            found[parameter.name] = given.text
    return found
