"""Completion: the keys, services, parameters, values and units that may stand at the cursor.

A text that is being written is most often no YAML: the cursor's position is found in what stands before it.
"""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import yaml
from lsprotocol import types

from dodo_dsl.check import file_rules
from dodo_dsl.lsp import editor_schema
from dodo_dsl.lsp.documents import Steps, below
from dodo_dsl.lsp.editor_schema import is_offered, written
from dodo_dsl.lsp.hover import parameter_text, service_text
from dodo_dsl.lsp.project import USES, WITH, DocumentContext
from dodo_dsl.source import Mapping, Scalar, parse
from dodo_dsl.spec import matrix, quantity, vary
from dodo_dsl.spec.manifest import Manifest, Parameter
from dodo_dsl.spec.model import ANY, LAYERS
from dodo_dsl.spec.rig import EMULATED_RIGS, KIND_TAGS

_LOADER: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
_MARK = "xCursorx"
_WORD = re.compile(r"(?:\$\{[\w.-]*|[^\s,{}\[\]\"':]*)\Z")
_MAX_TEXT = 1 << 20


@dataclass(frozen=True)
class Cursor:
    """The keys that lead to a word that is being written.

    ``word`` begins at ``start`` in the text; ``before`` is what its value has before it, as ``10`` in ``10 H``. For a
    key, ``steps`` end with the mapping, whose other keys are ``keys``. ``values`` has scalars by their steps: those
    before it, and those beside the keys that lead to it.
    """

    steps: Steps
    is_key: bool
    word: str
    start: int
    before: str = ""
    keys: tuple[str, ...] = ()
    values: dict[Steps, str] = field(default_factory=dict)


@dataclass
class _Open:
    """A collection whose end has not been read yet."""

    is_mapping: bool
    is_flow: bool
    key: str | None = None
    line: int = 0
    keys: list[str] = field(default_factory=list)
    index: int = 0

    def step(self) -> str | int | None:
        return self.key if self.is_mapping else self.index

    def filled(self) -> None:
        """The value at the step is complete."""
        self.key = None
        self.index += 1


def cursor(text: str, offset: int) -> Cursor | None:
    """The cursor at an index of the text; None if nothing can be said of it."""
    head = text[: min(offset, _MAX_TEXT)]
    match = _WORD.search(head)
    word = match[0] if match else ""
    start = len(head) - len(word)
    if head[:start].endswith(":"):
        return None  # a value begins after a space
    for ending in ("", ": "):
        if found := _read(head[:start] + _MARK + ending, word, start):
            return _with_rest(found, head[:start], text[offset:])
    return None


def _with_rest(found: Cursor, head: str, tail: str) -> Cursor:
    """The cursor with what stands behind it, where the text is YAML but for the word."""
    ending = ": " if found.is_key and not tail.startswith(":") else ""
    root, _ = parse(head + _MARK + ending + tail, "")
    values, keys = dict(found.values), found.keys
    for depth in range(len(found.steps) + 1):
        node = below(root, *map(str, found.steps[:depth]))
        if isinstance(node, Mapping):
            scalars = {key: entry.value for key, entry in node.entries.items() if isinstance(entry.value, Scalar)}
            values |= {(*found.steps[:depth], key): scalar.text for key, scalar in scalars.items() if key != _MARK}
            if depth == len(found.steps):
                keys = tuple(key for key in node.entries if key != _MARK)
    return replace(found, keys=keys, values=values)


def _read(text: str, word: str, start: int) -> Cursor | None:
    stack: list[_Open] = []
    values: dict[Steps, str] = {}
    for event in _events(text):
        if isinstance(event, yaml.MappingStartEvent | yaml.SequenceStartEvent):
            stack.append(_Open(isinstance(event, yaml.MappingStartEvent), bool(event.flow_style)))
        elif isinstance(event, yaml.MappingEndEvent | yaml.SequenceEndEvent):
            stack.pop()
            if stack:
                stack[-1].filled()
        elif isinstance(event, yaml.ScalarEvent):
            if event.value.endswith(_MARK):
                return _found(stack, event, Cursor((), True, word, start, values=values))
            _scalar(stack, event, values)
        elif isinstance(event, yaml.AliasEvent) and stack:
            stack[-1].filled()
    return None


def _events(text: str) -> Iterator[Any]:
    """The events of a text up to where it is not YAML."""
    try:
        yield from yaml.parse(text, Loader=_LOADER)
    except (yaml.YAMLError, ValueError):
        return


def _steps(stack: list[_Open]) -> Steps:
    return tuple(step for one in stack if (step := one.step()) is not None)


def _scalar(stack: list[_Open], event: Any, values: dict[Steps, str]) -> None:
    if not stack:
        return
    top = stack[-1]
    if top.is_mapping and top.key is None:
        top.key, top.line = event.value, event.start_mark.line
        top.keys.append(event.value)
    else:
        values[_steps(stack)] = event.value
        top.filled()


def _found(stack: list[_Open], event: Any, about: Cursor) -> Cursor:
    top = stack[-1] if stack else None
    steps = _steps(stack)
    if top is None or (top.is_mapping and top.key is None):
        return Cursor(steps, True, about.word, about.start, keys=tuple(top.keys if top else ()), values=about.values)
    begins_mapping = top.is_mapping and not top.is_flow and event.start_mark.line > top.line
    if begins_mapping:
        return Cursor(steps, True, about.word, about.start, values=about.values)
    before = event.value.removesuffix(_MARK).strip()
    return Cursor(steps, False, about.word, about.start, before, values=about.values)


_KEY, _SERVICE, _VALUE, _UNIT = (
    types.CompletionItemKind.Property,
    types.CompletionItemKind.Class,
    types.CompletionItemKind.Value,
    types.CompletionItemKind.Unit,
)
Offer = tuple[str, types.CompletionItemKind, str, str]
"""A word, what it is, what is next to it, and its documentation as Markdown."""
TRIGGERS = [" ", "{", "[", ",", "$", ".", "/"]


def completion(scene: DocumentContext, position: types.Position) -> types.CompletionList:
    at = cursor(scene.lines.text, scene.lines.index(position))
    items = []
    if at is not None:
        place = types.Range(scene.lines.position(at.start), position)
        items = [_item(number, offer, place) for number, offer in enumerate(_offers(scene, at))]
    return types.CompletionList(is_incomplete=False, items=items)


def _item(number: int, offer: Offer, place: types.Range) -> types.CompletionItem:
    word, kind, detail, documentation = offer
    text = f"{word}: " if kind == _KEY else word
    return types.CompletionItem(
        label=word,
        kind=kind,
        detail=detail or None,
        documentation=types.MarkupContent(types.MarkupKind.Markdown, documentation) if documentation else None,
        sort_text=f"{number:03}",
        filter_text=word,
        text_edit=types.TextEdit(place, text),
    )


def _offers(scene: DocumentContext, at: Cursor) -> Iterator[Offer]:
    layered = scene.schema == "dodo" and len(at.steps) > 1 and at.steps[0] in LAYERS
    manifest = scene.manifest(at.steps, at.values.get((*at.steps[:2], USES), "")) if layered else None
    if layered and len(at.steps) > 2 and at.steps[2] == WITH:
        if manifest and at.is_key and len(at.steps) == 3:
            yield from _parameters(manifest, at.keys)
        elif (
            manifest
            and not at.is_key
            and len(at.steps) > 3
            and (parameter := manifest.parameters.get(str(at.steps[3])))
        ):
            yield from _values(scene, at, parameter)
    elif layered and at.steps[2:] == (USES,):
        yield from _services(scene, str(at.steps[0]))
    elif at.steps[:1] == ("rig",) and not at.is_key:
        yield from _rigs(scene, at.steps[1:])
    else:
        yield from _by_schema(scene, at)


def _by_schema(scene: DocumentContext, at: Cursor) -> Iterator[Offer]:
    part = editor_schema.keys_at(scene.schema, at.steps) or {}
    if at.is_key:
        for name in part.get("properties", {}):
            if name not in at.keys:
                about = editor_schema.keys_at(scene.schema, (*at.steps, name)) or {}
                yield name, _KEY, "", about.get("description", "")
    else:
        yield from ((value, _VALUE, "", "") for value in editor_schema.schema_values(part))


def _rigs(scene: DocumentContext, below: Steps) -> Iterator[Offer]:
    """Rigs by name; those of a pool (``below`` is what stands within ``rig``) in a list, or its kind."""
    rigs = scene.deployment.rigs if scene.deployment else {}
    if below == (ANY,):
        kinds = dict.fromkeys(rig.kind for rig in rigs.values())
        yield from ((kind, _VALUE, "kind of rigs", "") for kind in kinds)
    else:
        yield from ((name, _VALUE, "rig", "") for name in (*(() if below else (*KIND_TAGS, *EMULATED_RIGS)), *rigs))


def _services(scene: DocumentContext, layer: str) -> Iterator[Offer]:
    for manifest in scene.manifests.values():
        if layer in manifest.layers and is_offered(manifest):
            yield manifest.name, _SERVICE, manifest.description, service_text(manifest)


def _parameters(manifest: Manifest, present: Sequence[str]) -> Iterator[Offer]:
    """Those that are not written yet; required ones come first."""
    parameters = [p for p in manifest.parameters.values() if p.name not in present]
    for parameter in sorted(parameters, key=lambda p: not p.required):
        detail = " ".join(word for word in (parameter.type, parameter.unit.replace("1", "")) if word)
        yield parameter.name, _KEY, detail, parameter_text(parameter)


def _values(scene: DocumentContext, at: Cursor, parameter: Parameter) -> Iterator[Offer]:
    number = at.before.replace(".", "", 1).lstrip("+-").isdigit()
    if number and parameter.unit:
        yield from ((unit, _UNIT, f"{at.before} {unit}", "") for unit in quantity.units_of(parameter.unit))
        return
    for name in _placeholders(scene, at):
        yield f"${{{name}}}", _VALUE, "each value of the matrix" if name.startswith("matrix.") else "the range", ""
    if parameter.among:
        yield from ((name, _VALUE, parameter.among, "") for name in _named(scene, at, parameter))
    elif parameter.type == "boolean":
        yield from (("true", _VALUE, "", ""), ("false", _VALUE, "", ""))
    elif parameter.choices:
        yield from ((choice, _VALUE, "", "") for choice in parameter.choices)
    elif len(at.steps) == 4:
        example = parameter.default if parameter.default not in (None, []) else parameter.example
        if example is not None and not isinstance(example, list):
            detail = "default" if parameter.default is example else "for example"
            yield str(written(parameter, example)), _VALUE, detail, ""


def _placeholders(scene: DocumentContext, at: Cursor) -> list[str]:
    """``matrix.light``, ``vary.speed``: those of the document before the cursor, and those of the extended test."""
    found = [f"{steps[0]}.{steps[1]}" for steps in at.values if steps[0] in (matrix.KEY, vary.KEY) and len(steps) > 1]
    if spec := scene.test.spec if scene.test else None:
        found += [f"{matrix.KEY}.{name}" for name, _ in spec.choice.values]
        found += [f"{vary.KEY}.{one.name}" for one in spec.ranges]
    return list(dict.fromkeys(found))


def _named(scene: DocumentContext, at: Cursor, parameter: Parameter) -> list[str]:
    """The names of the map, or other file, that the service has according to its text, or else to the last check."""
    source, keys = file_rules.sources(parameter.among)
    here = at.values.get((*at.steps[:3], source)), *(text for key, text in at.values.items() if key[3:] == (source,))
    service = scene.service(str(at.steps[0]), str(at.steps[1]))
    argument = service.arguments.get(source) if service else None
    checked = argument.value.path if argument and argument.value else None
    path = next((scene.path.parent / text for text in here if text), checked)
    if path is None:
        return []
    listed = [file_rules.entries(path / file_rules.MAP if path.is_dir() else path, key) for key in keys]
    names = [name for found in listed if not isinstance(found, str) for name in found if name]
    return list(dict.fromkeys([*names, *parameter.words]))
