"""A file's tests: read, merged over what it extends, set by the command line, and made into instances.

Settings of the command line override the specs before anything is checked or built. ``rig: dynamic``, a test that any
rig of a kind may run, is an instance for each of them.
"""

from collections.abc import Collection, Iterator
from collections.abc import Mapping as Known
from dataclasses import dataclass, replace
from pathlib import Path

from dodo_dsl.diagnostics import Diagnostic, Span, did_you_mean, has_errors, shown_path
from dodo_dsl.source import Entry, Mapping, Node, Reader, Scalar, path_of, read
from dodo_dsl.spec import matrix, vary
from dodo_dsl.spec.matrix import MATRIX, Choice, without
from dodo_dsl.spec.model import LAYERS, Spec, spec_of
from dodo_dsl.spec.registry import Location, near_path
from dodo_dsl.spec.rig import KIND_TAGS, Rig
from dodo_dsl.spec.validation import Path as ValuePath
from dodo_dsl.spec.validation import schema_of_keys, valid_part, validate, without_places

EXTENDS = "extends"
MAX_CHAIN = 8
SHIPPED = "dodo:"

_OWN = (EXTENDS, "name")
_USES = "uses"
Loaded = tuple[list[Spec], list[Diagnostic]]
"""The instances of a file, and its problems."""

_MOST_WRONG = 20
"""Instances with mistakes after which no others are read: most have the same ones."""


def load_spec(location: Location, reader: Reader = read) -> Loaded:
    node, found = reader(location.path)
    if node is None:
        return [Spec(location)], found or [_nothing_in(location.path)]
    node, problems = resolve(node, location.path, location.root, reader)
    found, is_whole = [*found, *problems], not has_errors(problems)
    if isinstance(node, Mapping) and EXTENDS in node.entries:
        return [_by_name(location, node)], [*found, *_surely_wrong(node)]
    if not isinstance(node, Mapping):
        return [Spec(location)], [*found, *validate(node, "dodo")]
    specs, problems = _instances(location, node, is_whole)
    return specs, [*found, *problems]


def _instances(location: Location, node: Mapping, is_whole: bool) -> Loaded:
    choices, found = matrix.choices(node)
    of_matrix = list(matrix.PLACEHOLDERS.unknown(node))
    of_ranges = list(vary.PLACEHOLDERS.unknown(node))
    found += of_matrix or matrix.PLACEHOLDERS.idle(node)
    found += of_ranges or vary.PLACEHOLDERS.idle(node)
    spans = {key: entry.value.span for key, entry in node.entries.items()}
    wrong, specs = 0, list[Spec]()
    for choice in choices:
        if wrong >= _MOST_WRONG:
            break
        template = matrix.PLACEHOLDERS.filled(node, dict(choice.values))
        ranges, problems = vary.read(template)
        found += problems
        instance = vary.PLACEHOLDERS.filled(template, vary.nominal(ranges))
        _, problems, places = valid_part(without(instance, MATRIX) if specs else instance, "dodo")
        found += [d for d in problems if is_whole or not _is_missing(d, node)]
        wrong += bool(problems)
        template = without_places(template, places)
        spec = Spec(location, choice=choice, spans=spans, is_whole=is_whole and not _hides_services(places))
        spec = _at(replace(spec, ranges=ranges, template=template), {})
        corners, problems = _corners(spec, is_valid=not places)
        found += problems
        specs.append(replace(spec, corners=corners, template=template if ranges else None))
    return specs, found


def _hides_services(places: Collection[ValuePath]) -> bool:
    """Whether services may be in what is not valid: in a layer, or in an unknown key, most likely a misspelt layer."""
    known = schema_of_keys("dodo")["properties"]
    return any(place[0] in LAYERS or place[0] not in known for place in places)


def _by_name(location: Location, node: Node) -> Spec:
    """All that is certain of a test without the one that it extends."""
    name = node.get("name") if isinstance(node, Mapping) else None
    if not isinstance(name, Scalar) or not isinstance(name.value, str):
        return Spec(location, is_whole=False)
    return Spec(location, name=name.value, spans={"name": name.span}, is_whole=False)


def _surely_wrong(node: Mapping) -> Iterator[Diagnostic]:
    """The problems that a test has whatever the one holds that it extends."""
    entry = node.entries[EXTENDS]
    places = (entry.key, entry.value.span)
    return (d for d in validate(node, "dodo") if d.rule in ("unknown-key", "yaml-tag") or d.span in places)


def _nothing_in(file: Path) -> Diagnostic:
    return Diagnostic(Span(str(file)), "missing-key", "the file is empty, expected a test")


def resolve(node: Node, file: Path, root: Path, reader: Reader = read) -> tuple[Node, list[Diagnostic]]:
    """The spec merged over everything that it extends; spans keep the file that each value was written in.

    Mappings merge deeply, scalars and lists replace, null removes. It keeps its key ``extends`` where one of the files
    cannot be read. ``root`` is the registry's folder, which holds all of them.
    """
    return _resolve(node, (file,), root.resolve(), reader)


def _resolve(node: Node, chain: tuple[Path, ...], root: Path, reader: Reader) -> tuple[Node, list[Diagnostic]]:
    written = node.get(EXTENDS) if isinstance(node, Mapping) else None
    if not isinstance(node, Mapping) or not isinstance(written, Scalar) or not isinstance(written.value, str):
        return node, []  # reported by the schema
    path = path_of(chain[-1].parent, written.text)
    if path is None:
        return node, [Diagnostic(written.span, "extends-file", f"'{written.text[:60]}' is not a path")]
    problem = _problem(written, path, chain, root)
    if problem:
        return node, [problem]
    base, found = reader(path)
    if not isinstance(base, Mapping):
        if base is None and not found:
            found = [_nothing_in(path)]
        elif not found:
            found = [Diagnostic(written.span, "extends-file", f"'{written.text}' does not contain a test")]
        return node, found
    below, deeper = _resolve(base, (*chain, path), root, reader)
    problems = [*found, *deeper]
    assert isinstance(below, Mapping), "a mapping resolves to one"
    if EXTENDS in below.entries:
        return node, problems
    inherited = Mapping(base.span, {key: entry for key, entry in below.entries.items() if key not in _OWN})
    own = Mapping(node.span, {key: entry for key, entry in node.entries.items() if key != EXTENDS}, node.tag)
    return _merge(inherited, own, problems), problems


def _problem(written: Scalar, path: Path, chain: tuple[Path, ...], root: Path) -> Diagnostic | None:
    if not path.is_relative_to(root):
        message = f"'{written.text}' leaves the registry"
        return Diagnostic(written.span, "path-escape", message, "a test can only extend tests of its own registry")
    if path in chain:
        names = " extends ".join(p.name for p in (*chain[chain.index(path) :], path))
        return Diagnostic(written.span, "extends-cycle", f"the test extends itself: {names}")
    if len(chain) > MAX_CHAIN:
        return Diagnostic(written.span, "extends-cycle", f"the chain of extended tests is longer than {MAX_CHAIN}")
    if path.is_dir():
        specs = sorted(p.name for p in path.glob("*.dodo.yml"))[:6]
        hint = f"write '{written.text}/{specs[0]}'" if len(specs) == 1 else ""
        return Diagnostic(written.span, "extends-file", f"'{written.text}' is a folder, expected a test's file", hint)
    if not path.is_file():
        message = f"there is no file '{written.text}' to extend"
        hint = near_path(written.text, chain[-1].parent, root, lambda near: near.is_file() and near not in chain)
        if written.text.startswith(SHIPPED):
            hint = "'dodo new NAME --extends TEST' copies a test that ships with DoDo"
        return Diagnostic(written.span, "extends-file", message, hint)
    return None


def _merge(base: Mapping, child: Mapping, problems: list[Diagnostic], depth: int = 0) -> Mapping:
    entries = dict(base.entries)
    for key, entry in child.entries.items():
        under = entries.get(key)
        if isinstance(entry.value, Scalar) and entry.value.value is None:
            if entries.pop(key, None) is None:
                problems.append(_nothing(key, entry.key, base))
        elif under and isinstance(entry.value, Mapping) and isinstance(under.value, Mapping):
            entries[key] = Entry(entry.key, _merged(under.value, entry.value, problems, depth))
        else:
            entries[key] = entry
    return Mapping(child.span, entries, child.tag)


def _merged(base: Mapping, child: Mapping, problems: list[Diagnostic], depth: int) -> Mapping:
    """A service with another ``uses`` replaces the base's: the base's parameters do not apply to it."""
    before, after = base.get(_USES), child.get(_USES)
    if depth == 1 and after is not None and getattr(before, "text", None) != getattr(after, "text", None):
        return child
    return _merge(base, child, problems, depth + 1)


def _nothing(key: str, span: Span, base: Mapping) -> Diagnostic:
    message = f"'{key}' is empty, which would remove it, but {shown_path(base.span.file)} has no such key"
    return Diagnostic(span, "extends-nothing", message, did_you_mean(key, base.entries))


def varied(spec: Spec, values: vary.Values, choice: Choice) -> Spec:
    """The instance with these values of its ranges, the nominal ones for others, and another choice as its name."""
    return replace(_at(replace(spec, choice=choice), values), rig=spec.rig, pool=spec.pool)


def _instance(spec: Spec, values: vary.Values) -> Mapping:
    assert spec.template is not None, "only for specs with ranges"
    return vary.PLACEHOLDERS.filled(spec.template, vary.nominal(spec.ranges) | values)


def _at(spec: Spec, values: vary.Values) -> Spec:
    found = spec_of(spec.location, _instance(spec, values), spec.choice, spec.spans, spec.is_whole)
    return replace(found, ranges=spec.ranges, template=spec.template)


def _corners(spec: Spec, *, is_valid: bool) -> tuple[tuple[Spec, ...], list[Diagnostic]]:
    """The spec at the ends of its ranges, and of one that ``is_valid`` what its schema says of these."""
    corners, found = [], []
    if not spec.ranges or spec.template is None:
        return (), []
    for values in vary.corners(spec.ranges):
        corner = replace(spec, choice=Choice((*spec.choice.values, *values.items())))
        if is_valid:
            _, problems, places = valid_part(without(_instance(spec, values), MATRIX), "dodo")
            found += problems
            corner = replace(corner, template=without_places(spec.template, places))
        corners.append(_at(corner, values))
    return tuple(corners), found


def _is_missing(diagnostic: Diagnostic, node: Node) -> bool:
    """Whether a key is missing in the test itself, which the test that it extends may have."""
    return diagnostic.rule == "missing-key" and diagnostic.span == node.span


@dataclass(frozen=True)
class Settings:
    """Inputs of a compilation; None keeps the value of the specs.

    ``wall_timeout_s`` limits the wall time of a test in lockstep, in seconds. ``repeat`` is how often each test runs.
    ``emulate`` takes emulated rigs for all.
    """

    clock: str | None = None
    isolation: str | None = None
    seed: int | None = None
    wall_timeout_s: float | None = None
    repeat: int = 1
    emulate: bool = False


def applied(spec: Spec, settings: Settings) -> Spec:
    """The spec with the settings; a test on hardware keeps its clock."""
    if settings.clock and spec.level != "hil":
        spec = replace(spec, clock=settings.clock)
    if settings.isolation:
        spans = {key: span for key, span in spec.spans.items() if key != "isolation"}
        spec = replace(spec, isolation=settings.isolation, spans=spans)
    return spec if settings.seed is None else replace(spec, seed=settings.seed)


DIMENSION = "rig"


def members(kind: str, rigs: Known[str, Rig]) -> list[Rig]:
    """The rigs of a kind, in the deployment's order: real ones, or one that is emulated."""
    found = [rig for rig in rigs.values() if rig.kind == kind and rig.is_whole]
    return [rig for rig in found if not rig.is_emulated] or found[:1]


def on_each(spec: Spec, rigs: Known[str, Rig]) -> list[Spec]:
    """A spec that names a kind of rigs on each of them, any other as it is."""
    if spec.rig is None or spec.rig not in KIND_TAGS or spec.rig in rigs:
        return [spec]
    found = members(spec.rig, rigs)
    return [_on(spec, rig, spec.rig if len(found) > 1 else "") for rig in found] or [spec]


def of_test(spec: Spec) -> Spec:
    """The spec under the name that its test has whichever rig of its pool runs it."""
    if not spec.pool:
        return spec
    values = list(spec.choice.values)
    place = max(n for n, (name, _) in enumerate(values) if name == DIMENSION)  # a matrix may have one of that name, too
    return replace(spec, choice=replace(spec.choice, values=(*values[:place], *values[place + 1 :])))


def _on(spec: Spec, rig: Rig, pool: str) -> Spec:
    name = Scalar(spec.span(DIMENSION), rig.name, rig.name)
    corners = tuple(_on(corner, rig, pool) for corner in spec.corners)
    choice = Choice((*spec.choice.values, (DIMENSION, name))) if pool else spec.choice
    return replace(spec, rig=rig.name, pool=pool, choice=choice, corners=corners)
