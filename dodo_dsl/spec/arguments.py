"""The arguments of a test's services: the value of each parameter, and where it comes from."""

import functools
from collections.abc import Mapping
from dataclasses import dataclass, replace

from dodo_dsl.diagnostics import Diagnostic
from dodo_dsl.opendlv.assets import map_file
from dodo_dsl.source import Entry, walk
from dodo_dsl.spec.manifest import FRAMES, Manifest, Parameter, Ports, holds
from dodo_dsl.spec.model import Spec, Use
from dodo_dsl.spec.rig import Rig
from dodo_dsl.spec.values import Value, ValueProblem, convert, default_value

FRAME = "opendlv.sim.Frame"


@dataclass(frozen=True)
class Argument:
    """A parameter's value as its flag carries it, converted once.

    ``entry`` is where it is written, None for the manifest's default. ``value`` is None when there is no value, when
    the written one does not fit, which ``problem`` then describes, and when it has no effect beside other parameters.
    """

    parameter: Parameter
    entry: Entry | None = None
    value: Value | None = None
    problem: Diagnostic | None = None

    @property
    def text(self) -> str | None:
        return self.value.text if self.value else None


@dataclass(frozen=True)
class ResolvedService:
    """A service of a test with its manifest and the arguments of all its parameters, by name."""

    use: Use
    manifest: Manifest
    arguments: Mapping[str, Argument]

    @functools.cached_property
    def messages(self) -> Ports:
        """The messages that it consumes and produces with these arguments."""
        return self.manifest.messages_with(self.texts)

    @functools.cached_property
    def texts(self) -> Mapping[str, str]:
        """The values as strings; parameters without a fitting value are missing."""
        return {name: a.value.text for name, a in self.arguments.items() if a.value is not None}

    @property
    def ends_input(self) -> bool:
        """Whether it ends the input of its test, as a recording does that is not repeated, and the end of a path."""
        texts = self.texts
        has_end = any(texts.get(name) for name in ("path", "points", "length")) and texts.get("hold") == "false"
        return self.use.layer != "evaluation" and (has_end or texts.get("autorewind") == "false")

    def filling(self, placeholder: str) -> str | None:
        """What stands for a placeholder of the manifest's ports; None if its parameter has no fitting value.

        Of the frames at which a map has models, that of ``frame-id`` is the service's own vehicle.
        """
        frames = FRAMES.fullmatch(placeholder)
        if placeholder in self.arguments or frames is None:
            return self.texts.get(placeholder)
        argument = self.arguments.get(frames["map"])
        path = argument.value.path if argument and argument.value else None
        if path is None:
            return None
        stamps = map(str, map_file.read_frames(path))
        return ",".join(f"{FRAME}/{stamp}" for stamp in stamps if stamp != self.texts.get("frame-id")) or None


def written(spec: Spec, use: Use, parameter: Parameter, rig: Rig | None) -> Entry | None:
    """The entry that sets a parameter: in its service, in another service that shares it, or in the rig."""
    own = use.parameters.get(parameter.name)
    if own is not None:
        return own
    if parameter.shared:
        for other in spec.uses:
            is_meant = parameter.shared in (True, other.uses.text)
            if is_meant and other is not use and parameter.name in other.parameters:
                return other.parameters[parameter.name]
    return rig.entry(parameter.rig) if rig and parameter.rig else None


def argument(spec: Spec, use: Use, parameter: Parameter, rig: Rig | None) -> Argument:
    """The argument of one parameter, the default included."""
    entry = written(spec, use, parameter, rig)
    if entry is None:
        return Argument(parameter, None, default_value(parameter))
    if any(node.tag for node in walk(entry.value)):
        return Argument(parameter, entry)  # which is a problem of its own
    try:
        return Argument(parameter, entry, convert(parameter, entry.value, spec.location.root))
    except ValueProblem as problem:
        return Argument(parameter, entry, None, _where_written(problem.diagnostic, entry, parameter, rig))


def _where_written(problem: Diagnostic, entry: Entry, parameter: Parameter, rig: Rig | None) -> Diagnostic:
    """The problem of a value that the rig gives, under the key that it has there."""
    if rig is None or not parameter.rig or entry is not rig.entry(parameter.rig):
        return problem
    own, given = f"parameter '{parameter.name}'", f"'{parameter.rig}' of rig '{rig.name}'"
    return replace(problem, message=problem.message.replace(own, given, 1))


def resolved(
    spec: Spec, use: Use, manifest: Manifest, rig: Rig | None, like: Mapping[str, Argument] | None = None
) -> ResolvedService:
    """A service with all its arguments; those of ``like`` that come from the very same entry are taken over.

    The instances of a matrix share the entries that do not depend on it, and so their arguments. Parameters without an
    effect beside others have no value.
    """
    arguments: dict[str, Argument] = {}
    texts: dict[str, str] = {}
    for name, parameter in sorted(manifest.parameters.items(), key=lambda item: bool(item[1].when)):
        entry, known = written(spec, use, parameter, rig), like.get(name) if like else None
        is_of_test = parameter.driving or parameter.within_timeout
        same = known is not None and known.parameter is parameter and known.entry is entry and not is_of_test
        if not holds(parameter.when, texts):
            arguments[name] = known if known and same and known.value is None else Argument(parameter, entry)
            continue
        is_known = known is not None and same and not (parameter.when and known.value is None)
        found = known if known is not None and is_known else argument(spec, use, parameter, rig)
        arguments[name] = found
        if found.value is not None:
            texts[name] = found.value.text
    return ResolvedService(use, manifest, {name: arguments[name] for name in manifest.parameters})
