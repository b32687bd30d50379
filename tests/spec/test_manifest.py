"""Manifests of services: what ships with DoDo, and a deployment's own."""

from pathlib import Path

from dodo_dsl import package_data
from dodo_dsl.spec.manifest import Ports, in_words, load_manifest, load_manifests

OWN = """\
name: {name}
layers: [evaluation]
image: judge
process: [python, -m, judge]
description: Judges.
parameters:
  wait: {{type: number, unit: s, default: 1, help: Time., within-timeout: true, setup-times: 2}}
  kind: {{type: string, choices: [a, b], help: Kind.}}
messages: {{in: [a.B]}}
example: [--wait=1]
"""


def write(folder: Path, name: str, text: str) -> Path:
    (folder / name).mkdir(parents=True)
    (folder / name / "service.yml").write_text(text)
    return folder / name / "service.yml"


def test_a_manifest(tmp_path: Path) -> None:
    manifest, problems = load_manifest(write(tmp_path, "own", OWN.format(name="own")))
    assert problems == []
    assert manifest is not None
    assert (manifest.folder, manifest.name, manifest.layers) == (tmp_path / "own", "own", ("evaluation",))
    wait, kind = manifest.parameters.values()
    assert (wait.within_timeout, wait.setup_times, wait.unit, wait.default) == (True, 2, "s", 1)
    assert (kind.choices, kind.required, kind.default) == (("a", "b"), False, None)
    assert (manifest.messages, manifest.memory) == (Ports(("a.B",)), Ports())
    assert manifest.example == ("--wait=1",)


CASES = """
name: own
layers: [action]
image: own
process: [own]
description: Moves.
parameters:
  kind: {type: string, choices: [a, b], help: Kind.}
  fast: {type: boolean, default: false, help: Speed.}
  size: {type: number, help: Size., when: {kind: [b], fast: [true]}}
messages:
  in: [a.Always]
  cases:
    - {when: {kind: ["", a]}, in: [a.First, a.Second]}
    - {when: {kind: [b], fast: [true]}, in: ["b.One/{size}"], out: [b.Out]}
"""


def test_messages_and_parameters_depend_on_other_parameters(tmp_path: Path) -> None:
    manifest, problems = load_manifest(write(tmp_path, "own", CASES))
    assert manifest is not None and problems == []
    first, second = Ports(("a.First", "a.Second", "a.Always")), Ports(("b.One/{size}", "a.Always"), ("b.Out",))
    assert manifest.messages_with({}) == manifest.messages_with({"kind": "a", "fast": "true"}) == first
    assert manifest.messages_with({"kind": "b", "fast": "true"}) == second
    assert manifest.messages_with({"kind": "b", "fast": "false"}) == Ports(("a.Always",))
    assert manifest.all_messages.outputs == ("b.Out",)
    assert in_words(manifest.parameters["size"].when) == "with kind: b and fast: true"


def test_what_ships_is_sound_and_named_as_its_folder() -> None:
    """So that it is read without a check, when it is asked for."""
    for file in package_data.services().glob("*/service.yml"):
        manifest, problems = load_manifest(file)
        assert manifest is not None and problems == []
        assert manifest == load_manifests()[0][file.parent.name.replace("_", "-")]
