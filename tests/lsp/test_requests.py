"""Hover, completion, definitions and the outline, as an editor asks for them."""

from pathlib import Path
from typing import Any

import pytest

from tests.lsp.conftest import LONGER, SPEC, Repository
from tests.lsp.editor import ROOT, Editor

MATRIX = SPEC.replace("environment:", "matrix: {light: [normal, dark]}\nvary: {exp: {from: 1, to: 2}}\nenvironment:", 1)


def position(text: str, word: str) -> tuple[int, int]:
    """The line and character of a word's begin, which count from 0."""
    before = text[: text.index(word)]
    return before.count("\n"), len(before.rpartition("\n")[2])


def hover(editor: Editor, path: Path, text: str, word: str) -> str:
    found = editor.at("textDocument/hover", path, *position(text, word))
    return found["contents"]["value"] if found else ""


@pytest.mark.parametrize(
    ("word", "parts"),
    [
        ("freq:", ["**freq**: number in Hz, default `10 Hz`", "Rate of the images. From 0.1 to 1000 Hz."]),
        ("10 Hz", ["**freq**: number in Hz"]),
        ("walls:", ["**walls**: list", "must not be touched"]),
        ("right]", ["**walls**: list"]),
        (
            "virtual-camera",
            ["**virtual-camera**: Draws what a camera", "Layer: environment.", "video0.argb` to the app"],
        ),
        ("pose:", ["**integrator**:", "- `opendlv.sim.Frame/0` to camera, track", "from vehicle"]),
        ("vehicle:", ["opendlv.proxy.GroundSteeringRequest` from the application"]),
        (
            "clock:",
            ["**clock**: Clock of the test", "One of `realtime`, `lockstep`, `virtual`.", "Default: `realtime`."],
        ),
        ("uses: collision", ["**uses**"]),
        ("environment:", ["**environment**"]),
    ],
)
def test_hover_explains(word: str, parts: list[str], opened: Editor, repository: Repository) -> None:
    text = hover(opened, repository.spec, SPEC, word)
    assert [part for part in parts if part not in text] == [], text


@pytest.mark.thorough
def test_hover_knows_what_an_extended_test_uses(opened: Editor, repository: Repository) -> None:
    opened.open(repository.longer)
    assert "Test time within which the goal" in hover(opened, repository.longer, LONGER, "max-time")
    opened.close(repository.longer)


@pytest.mark.thorough
def test_hover_explains_the_deployment(opened: Editor, repository: Repository) -> None:
    opened.open(repository.deployment)
    text = repository.deployment.read_text()
    assert hover(opened, repository.deployment, text, "registry").startswith("**registry**: ")
    opened.close(repository.deployment)


def offers(editor: Editor, repository: Repository, written: str) -> dict[str, dict[str, Any]]:
    """What is offered at ``|`` in a text, by label."""
    line, character = position(written, "|")
    editor.type(repository.spec, written.replace("|", ""))
    found = editor.at("textDocument/completion", repository.spec, line, character)
    return {item["label"]: item for item in found["items"]}


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("before", "after", "there", "absent"),
    [
        ("uses: virtual-camera", "uses: virt|", ["virtual-camera", "camera", "rec-replay"], ["collision", "clock"]),
        ("  pose:\n    uses: integrator", "  pose:\n    uses: |", ["integrator", "gantry"], ["virtual-camera"]),
        ("freq: 10 Hz", "fr|", ["freq", "width"], ["map-path", "z", "goal"]),
        ("yaw: 84 deg", "yaw: 84 deg\n      |", ["x", "freq"], ["yaw"]),
        ("freq: 10 Hz", "freq: 10 |", ["Hz", "kHz"], ["m"]),
        ("yaw: 84 deg", "yaw: |", ["0 deg"], ["Hz"]),
        ("with:\n      yaw: 84 deg", "with: |", [], ["yaw"]),
        ("goal: finish", "goal: |", ["finish", "left"], ["Hz"]),
        ("walls: [left, right]", "walls: [left, |", ["right", "finish"], ["collision"]),
        ("level: sil", "level: |", ["sil", "dil", "hil"], []),
        ("clock: lockstep\n", "clock: lockstep\n|\n", ["seed", "matrix"], ["clock", "level"]),
        ("pose:\n    uses: integrator", "pose:\n    |", ["uses"], ["with", "freq"]),
        ("level: sil\n", "level: hil\nrig: |\n", ["emulated"], []),
        ("level: sil\n", "level: hil\nrig: {|\n", ["any"], ["emulated"]),
        ("level: sil\n", "level: hil\nrig: {any: |\n", ["static"], ["kiwi", "emulated"]),
        ("level: sil\n", "level: hil\nrig: {any: [|\n", ["kiwi"], ["static", "emulated"]),
    ],
)
def test_completion_offers_what_may_stand_there(
    before: str, after: str, there: list[str], absent: list[str], opened: Editor, repository: Repository
) -> None:
    found = offers(opened, repository, SPEC.replace(before, after))
    assert [name for name in there if name not in found] == []
    assert [name for name in absent if name in found] == []


def test_completion_replaces_what_is_written(opened: Editor, repository: Repository) -> None:
    written = SPEC.replace("z: 9.5 cm", "light.el|")
    item = offers(opened, repository, written)["light.elevation"]
    line, character = position(written, "light.el|")
    end = {"line": line, "character": character + len("light.el")}
    place = {"start": {"line": line, "character": character}, "end": end}
    assert item["textEdit"] == {"range": place, "newText": "light.elevation: "}
    assert "Elevation of the light" in item["documentation"]["value"]


def test_what_is_required_comes_first(opened: Editor, repository: Repository) -> None:
    found = offers(opened, repository, SPEC.replace("map-path: ../maps/straight", "|"))
    assert min(found.values(), key=lambda item: item["sortText"])["label"] == "map-path"


@pytest.mark.thorough
def test_completion_offers_placeholders(opened: Editor, repository: Repository) -> None:
    opened.change(repository.spec, MATRIX)
    found = offers(opened, repository, MATRIX.replace("freq: 10 Hz", "exposure: ${|"))
    assert {"${matrix.light}", "${vary.exp}"} <= found.keys()


def target(editor: Editor, path: Path, text: str, word: str) -> tuple[Path, int] | None:
    found = editor.at("textDocument/definition", path, *position(text, word))
    return (Path(found["uri"].removeprefix("file://")), found["range"]["start"]["line"]) if found else None


@pytest.mark.thorough
def test_definitions_lead_to_maps_and_manifests(opened: Editor, repository: Repository) -> None:
    camera = ROOT / "services" / "virtual_camera" / "service.yml"
    row = next(n for n, line in enumerate(camera.read_text().splitlines()) if line.startswith("  freq:"))
    assert target(opened, repository.spec, SPEC, "../maps/straight") == (repository.map, 0)
    assert target(opened, repository.spec, SPEC, "virtual-camera") == (camera, 0)
    assert target(opened, repository.spec, SPEC, "camera:") == (camera, 0)
    assert target(opened, repository.spec, SPEC, "freq:") == (camera, row)
    assert target(opened, repository.spec, SPEC, "closed-loop") is None


@pytest.mark.thorough
def test_definitions_lead_to_the_extended_test_and_the_application(opened: Editor, repository: Repository) -> None:
    opened.open(repository.longer)
    opened.open(repository.deployment)
    text = repository.deployment.read_text()
    assert target(opened, repository.longer, LONGER, "../sil-my") == (repository.spec, 0)
    compose = repository.folder / "docker-compose.yml"
    assert target(opened, repository.deployment, text, "docker-compose.yml") == (compose, 0)
    opened.close(repository.longer)
    opened.close(repository.deployment)


def test_the_outline_has_layers_services_and_parameters(opened: Editor, repository: Repository) -> None:
    params = {"textDocument": {"uri": repository.spec.as_uri()}}
    found = {symbol["name"]: symbol for symbol in opened.request("textDocument/documentSymbol", params)}
    assert list(found) == [line.partition(":")[0] for line in SPEC.splitlines() if not line.startswith(" ")]
    services = {symbol["name"]: symbol for symbol in found["action"]["children"]}
    assert {name: symbol["detail"] for name, symbol in services.items()} == {
        "vehicle": "dynamic-model",
        "pose": "integrator",
    }
    (yaw,) = services["pose"]["children"]
    assert (yaw["name"], yaw["detail"]) == ("yaw", "84 deg")
    assert (
        services["pose"]["range"]["end"] == yaw["range"]["end"] == {"line": 14, "character": len("      yaw: 84 deg")}
    )
    assert found["level"]["detail"] == "sil"


@pytest.mark.thorough
def test_requests_about_any_text_are_answered(opened: Editor, repository: Repository) -> None:
    for text in (
        "",
        "\0",
        "a: [",
        "action:\n  pose:\n    uses: integrator\n    with: ",
        "- a\n- {",
        "evaluation:\n  a:\n    with: {x",
        "evaluation: {a: {uses: [], with: 1}}",
        "🚗: 🚗",
    ):
        opened.change(repository.spec, text)
        for line in range(text.count("\n") + 2):
            for method in ("hover", "completion", "definition"):
                opened.at(f"textDocument/{method}", repository.spec, line, 99)
                opened.at(f"textDocument/{method}", repository.spec, line, 2)
        opened.request("textDocument/documentSymbol", {"textDocument": {"uri": repository.spec.as_uri()}})
