"""Completion: the keys, services, parameters, values and units that may stand at the cursor."""

from collections.abc import Iterator, Sequence

from lsprotocol import types

from dodo_dsl.check.rules.inputs import references
from dodo_dsl.lsp import schema_keys
from dodo_dsl.lsp.hover import parameter_text, service_text
from dodo_dsl.lsp.incomplete import Cursor, cursor
from dodo_dsl.lsp.scene import USES, WITH, DocumentContext
from dodo_dsl.lsp.tree import Steps
from dodo_dsl.spec import quantity
from dodo_dsl.spec.deployment.rig import EMULATED_RIGS
from dodo_dsl.spec.instances import matrix, vary
from dodo_dsl.spec.manifest import Manifest, Parameter
from dodo_dsl.spec.model import LAYERS
from dodo_dsl.spec.pool import ANY
from dodo_dsl.spec.schema.editor_schema import is_offered, written

_KEY, _SERVICE, _VALUE, _UNIT = (
    types.CompletionItemKind.Property,
    types.CompletionItemKind.Class,
    types.CompletionItemKind.Value,
    types.CompletionItemKind.Unit,
)
Offer = tuple[str, types.CompletionItemKind, str, str]
"""A word, what it is, what stands beside it, and its documentation as Markdown."""
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
    part = schema_keys.at(scene.schema, at.steps) or {}
    if at.is_key:
        for name in part.get("properties", {}):
            if name not in at.keys:
                about = schema_keys.at(scene.schema, (*at.steps, name)) or {}
                yield name, _KEY, "", about.get("description", "")
    else:
        yield from ((value, _VALUE, "", "") for value in schema_keys.values(part))


def _rigs(scene: DocumentContext, below: Steps) -> Iterator[Offer]:
    """Rigs by name; those of a pool (``below`` is what stands within ``rig``) in a list, or its kind."""
    rigs = scene.deployment.rigs if scene.deployment else {}
    if below == (ANY,):
        kinds = dict.fromkeys(rig.kind for rig in rigs.values())
        yield from ((kind, _VALUE, "kind of rigs", "") for kind in kinds)
    else:
        yield from ((name, _VALUE, "rig", "") for name in (*(() if below else EMULATED_RIGS), *rigs))


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
    source, _, key = parameter.among.partition(".")
    here = at.values.get((*at.steps[:3], source)), *(text for key, text in at.values.items() if key[3:] == (source,))
    service = scene.service(str(at.steps[0]), str(at.steps[1]))
    argument = service.arguments.get(source) if service else None
    checked = argument.value.path if argument and argument.value else None
    path = next((scene.path.parent / text for text in here if text), checked)
    if path is None:
        return []
    found = references.entries(path / references.MAP if path.is_dir() else path, key)
    return [] if isinstance(found, str) else [name for name in found if name]
