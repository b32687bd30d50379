"""Manifests of services: what ships with DoDo, and a deployment's own."""

from pathlib import Path

from dodo_dsl import package_data
from dodo_dsl.spec.manifest import Ports, load_manifest, load_manifests

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


def test_manifests_with_problems(tmp_path: Path) -> None:
    assert [p.message for p in load_manifest(write(tmp_path, "empty", ""))[1]] == [
        "the file is empty, expected a service's manifest"
    ]
    manifest, problems = load_manifest(write(tmp_path, "keys", OWN.format(name="own") + "other: 1\n"))
    assert (manifest, [p.rule for p in problems]) == (None, ["unknown-key"])
    manifest, problems = load_manifest(write(tmp_path, "wrong", OWN.format(name="own").replace("[a.B]", "['a.B/{x}']")))
    assert (manifest, [p.rule for p in problems]) == (None, ["wrong-manifest"])


def test_own_manifests_beside_the_shipped_ones(tmp_path: Path) -> None:
    write(tmp_path, "own", OWN.format(name="own"))
    manifests, problems = load_manifests((tmp_path,))
    assert problems == ()
    assert manifests["own"].folder == tmp_path / "own"
    assert manifests["collision"].folder.parent == package_data.services()


def test_names_that_are_taken(tmp_path: Path) -> None:
    write(tmp_path / "a", "own", OWN.format(name="own"))
    write(tmp_path / "b", "own", OWN.format(name="own"))
    write(tmp_path / "b", "other", OWN.format(name="collision"))
    manifests, problems = load_manifests((tmp_path / "a", tmp_path / "b"))
    assert manifests["own"].folder == tmp_path / "a/own"
    assert [problem.message for problem in problems] == [
        "the name 'collision' is taken by a service of DoDo",
        f"the name 'own' is taken by the service in {tmp_path / 'a/own'}",
    ]
