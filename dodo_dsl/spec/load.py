"""A file's tests: read, merged over what it extends, and made into instances."""

from collections.abc import Iterator
from dataclasses import replace

from dodo_dsl.diagnostics import Diagnostic, Span, has_errors
from dodo_dsl.source import Mapping, Node, Reader, Scalar, read, walk
from dodo_dsl.spec import extends, slips
from dodo_dsl.spec.instances import matrix, vary
from dodo_dsl.spec.instances.matrix import Choice
from dodo_dsl.spec.instances.placeholders import MATRIX, Placeholders, without
from dodo_dsl.spec.model import LAYERS, Spec, spec_of
from dodo_dsl.spec.registry import Location
from dodo_dsl.spec.schema.validation import validate

Loaded = tuple[list[Spec], list[Diagnostic]]
"""The instances of a file, and its problems."""

_MOST_WRONG = 20
"""Instances with mistakes after which no others are read: most have the same ones."""


def load_spec(location: Location, reader: Reader = read) -> Loaded:
    """The instances of a file, as far as it can be read, and its problems."""
    node, found = reader(location.path)
    if node is None:
        if not found:
            found = [extends.nothing_in(location.path)]
        return [Spec(location)], found
    node, problems = extends.resolve(slips.joined(node), location.path, location.root, reader)
    is_whole = not has_errors(problems)
    found = [*found, *problems]
    if extends.is_open(node):
        return [_by_name(location, node)], [*found, *_surely_wrong(node)]
    choices, problems = matrix.choices(node)
    found.extend(problems)
    if not isinstance(node, Mapping):
        return [Spec(location)], [*found, *validate(node, "dodo")]
    found.extend([*matrix.problems(node), *vary.problems(node)])
    specs = []
    checked_by_rules, wrong = _only_in_parameters(node, matrix.PLACEHOLDERS), 0
    for number, choice in enumerate(choices):
        if wrong >= _MOST_WRONG:
            break
        template = matrix.substitute(node, choice)
        assert isinstance(template, Mapping)
        ranges, problems = vary.read(template)
        found.extend(problems)
        spec, instance, problems = _at(Spec(location, choice=choice, is_whole=is_whole), template, ranges, {})
        found.extend(problems)
        if number == 0 or not checked_by_rules:
            checked = instance if number == 0 else without(instance, MATRIX)
            problems = validate(checked, "dodo")
            wrong += bool(problems)
            found.extend(d for d in problems if is_whole or not _is_missing(d, node))
        corners, problems = _corners(spec)
        found.extend(problems)
        unfilled = _unfilled(instance) if has_errors(found) else frozenset[Span]()
        specs.append(replace(spec, corners=corners, unfilled=unfilled))
    return specs, found


def _unfilled(instance: Mapping) -> frozenset[Span]:
    """Where placeholders are left, whose dimension or range has a problem."""
    kinds = (matrix.PLACEHOLDERS, vary.PLACEHOLDERS)
    return frozenset(one.span for one in walk(without(instance, MATRIX)) if any(kind.names(one) for kind in kinds))


def _by_name(location: Location, node: Node) -> Spec:
    """All that is certain of a test without the one that it extends."""
    name = node.get("name") if isinstance(node, Mapping) else None
    if not isinstance(name, Scalar) or not isinstance(name.value, str):
        return Spec(location, is_whole=False)
    return Spec(location, name=name.value, spans={"name": name.span}, is_whole=False)


def _surely_wrong(node: Node) -> Iterator[Diagnostic]:
    """The problems that a test has whatever the one holds that it extends."""
    entry = node.entries.get(extends.KEY) if isinstance(node, Mapping) else None
    places = (entry.key, entry.value.span) if entry else ()
    return (d for d in validate(node, "dodo") if d.rule in ("unknown-key", "yaml-tag") or d.span in places)


def varied(spec: Spec, values: vary.Values, choice: Choice) -> Spec:
    """The instance with these values of its ranges, the nominal ones for others, and another choice as its name."""
    assert spec.template is not None, "only for specs with ranges"
    found, _, _ = _at(replace(spec, choice=choice), spec.template, spec.ranges, values)
    return replace(found, rig=spec.rig) if spec.pool else found


def _at(
    spec: Spec, template: Mapping, ranges: tuple[vary.Range, ...], values: vary.Values
) -> tuple[Spec, Mapping, list[Diagnostic]]:
    """The spec that a template is with the values, the template with them, and the spec's problems."""
    instance = vary.PLACEHOLDERS.filled(template, vary.nominal(ranges) | values)
    assert isinstance(instance, Mapping)
    found, problems = spec_of(spec.location, instance, spec.choice, spec.is_whole)
    return replace(found, ranges=ranges, template=template if ranges else None), instance, problems


def _corners(spec: Spec) -> tuple[tuple[Spec, ...], list[Diagnostic]]:
    """The spec at the ends of its ranges, and problems of values there that no rule checks."""
    corners, found = [], []
    checked_by_rules = spec.template is None or _only_in_parameters(spec.template, vary.PLACEHOLDERS)
    for values in vary.corners(spec.ranges):
        choice = Choice((*spec.choice.values, *values.items()))
        assert spec.template is not None, "a spec with ranges has one"
        corner, instance, problems = _at(replace(spec, choice=choice), spec.template, spec.ranges, values)
        found.extend(problems)
        if not checked_by_rules and spec.is_whole:
            found.extend(validate(without(instance, MATRIX), "dodo"))
        corners.append(corner)
    return tuple(corners), found


def _is_missing(diagnostic: Diagnostic, node: Node) -> bool:
    """Whether a key is missing in the test itself, which the test that it extends may have."""
    return diagnostic.rule == "missing-key" and diagnostic.span == node.span


def _only_in_parameters(node: Mapping, placeholders: Placeholders) -> bool:
    """Whether all of these are under ``with``: rules check those values, so one instance's schema suffices."""
    for key, entry in node.entries.items():
        if key in LAYERS and isinstance(entry.value, Mapping):
            for use in entry.value.entries.values():
                if not isinstance(use.value, Mapping) or placeholders.names(without(use.value, "with")):
                    return False
        elif key not in (placeholders.key, MATRIX) and placeholders.names(entry.value):
            return False
    return True
