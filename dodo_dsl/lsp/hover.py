"""Hover: what a key, a service or a parameter means."""

from collections.abc import Iterator

from lsprotocol import types

from dodo_dsl.check.wiring import End, Wiring
from dodo_dsl.lsp import editor_schema
from dodo_dsl.lsp.documents import DocumentPlace, find
from dodo_dsl.lsp.editor_schema import description, written
from dodo_dsl.lsp.project import USES, DocumentContext
from dodo_dsl.spec.manifest import Manifest, Parameter
from dodo_dsl.terminal import printable


def hover(scene: DocumentContext, position: types.Position) -> types.Hover | None:
    place = find(scene.root, *scene.lines.place(position)) if scene.root else None
    text = _text(scene, place) if place else ""
    if place is None or not text:
        return None
    return types.Hover(types.MarkupContent(types.MarkupKind.Markdown, text), scene.lines.range(place.span))


def _text(scene: DocumentContext, place: DocumentPlace) -> str:
    if parameter := scene.parameter(place):
        return parameter_text(parameter)
    manifest = scene.manifest(place.steps)
    if manifest and (len(place.steps) == 2 or (place.steps[2:] == (USES,) and not place.is_key)):
        return "\n\n".join([service_text(manifest), *_wires(scene, str(place.steps[1]))])
    part = editor_schema.keys_at(scene.schema, place.steps)
    if part is None or "description" not in part:
        return ""
    options = [f"`{value}`" for value in editor_schema.schema_values(part)]
    what = "One of" if "enum" in part else "For example"
    facts = [f"{what} {', '.join(options)}."] if options and "const" not in part else []
    if "default" in part:
        facts.append(f"Default: `{part['default']}`.")
    key = next((step for step in reversed(place.steps) if isinstance(step, str)), "")
    return "\n\n".join([f"**{key}**: {part['description']}", *facts])


def parameter_text(parameter: Parameter) -> str:
    """Type, unit, default, range and help of a parameter, as Markdown."""
    kind = f"{parameter.type} in {parameter.unit}" if parameter.unit not in ("", "1") else parameter.type
    default = "" if parameter.default in (None, []) else f", default `{_plain(parameter)}`"
    choices = f"\n\nOne of {', '.join(f'`{choice}`' for choice in parameter.choices)}." if parameter.choices else ""
    return f"**{parameter.name}**: {kind}{default}\n\n{printable(description(parameter))}{choices}"


def _plain(parameter: Parameter) -> str:
    value = written(parameter, parameter.default)
    if isinstance(value, list):
        return ", ".join(map(str, value))
    return str(value).lower() if isinstance(value, bool) else str(value)


def service_text(manifest: Manifest) -> str:
    """What a service does and where it may stand, as Markdown."""
    return f"**{manifest.name}**: {printable(manifest.description)}\n\nLayer: {' or '.join(manifest.layers)}."


def _wires(scene: DocumentContext, name: str) -> Iterator[str]:
    """Who hears a service of the test, and whom it hears, as lists."""
    if scene.test is None:
        return
    wiring = scene.test.wiring
    sent = [
        f"- `{end.port}` to {_named([other.service for other in wiring.consumed if other.port.consumes(end.port)])}"
        for end in wiring.produced
        if end.service == name
    ]
    heard = [f"- `{end.port}` from {_sources(wiring, end)}" for end in wiring.consumed if end.service == name]
    if sent:
        yield "\n".join(["Sends", "", *sent])
    if heard:
        yield "\n".join(["Receives", "", *heard])


def _sources(wiring: Wiring, end: End) -> str:
    return _named([other.service for other in wiring.producers(end.port)])


def _named(services: list[str]) -> str:
    return ", ".join(dict.fromkeys(services)) or "the application"
