"""dodo rig truth: a snapshot of a rig's camera, and of a virtual scene its truth for object-detection."""

import argparse
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from dodo_dsl import atomic
from dodo_dsl.atomic import refuse_existing
from dodo_dsl.cli import selection
from dodo_dsl.cli.errors import UsageError
from dodo_dsl.cli.numbers import patience
from dodo_dsl.opendlv.picture_size import picture_size
from dodo_dsl.rec.coco import DataSet
from dodo_dsl.run.rigs import access
from dodo_dsl.run.rigs.leases import devices_in
from dodo_dsl.spec.deployment import Deployment
from dodo_dsl.spec.load import of_test
from dodo_dsl.spec.manifest import Manifest, load_manifests
from dodo_dsl.spec.model import Spec
from dodo_dsl.spec.rig import Rig

SUMMARY = "take a snapshot of the camera, and write the truth of a virtual scene for object-detection"
EXAMPLES = """examples:
  dodo rig truth emulated --test hil-camera --classes cone_yellow=yellow,cone_blue=blue -o truths/board.json
                                        the boxes of the virtual scene that the test's camera sees
  dodo rig truth kiwi-static -o truths/desk.json
                                        only a snapshot, truths/desk.png: any program that marks boxes and writes COCO
                                        makes truths/desk.json of it

It writes FILE.png (the snapshot) and of a scene FILE.json (COCO, in pixels).
"""


def add(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("rig", metavar="RIG", help="name of a rig in dodo.yml, or emulated")
    parser.add_argument("-o", "--output", metavar="FILE.json", type=Path, required=True, help="truth file to write")
    parser.add_argument("--test", metavar="TEST", help="test whose camera is used; required for the emulated rig")
    parser.add_argument("--classes", metavar="A=B,C=D", default="", help="classes of the models of a virtual scene, as "
                        "MODEL=CLASS (default: the models' names)")  # fmt: skip
    parser.add_argument("--force", action="store_true", help="replace existing files")
    parser.add_argument(
        "--wait", type=patience, default=60.0, metavar="S", help="maximum wait for a busy rig, in s (default: 60)"
    )


def make(options: argparse.Namespace, deployment: Deployment, rig: Rig, say: Callable[[str], None]) -> str:
    """Writes picture and truth; a sentence about them. Raises UsageError, OutputExists, RigProblem and LeaseTimeout."""
    output: Path = options.output
    if output.suffix != ".json":
        raise UsageError(f"--output is '{output}', expected a file that ends in .json")
    picture = output.with_suffix(".png")
    refuse_existing([picture, *([output] if rig.is_emulated else [])], options.force)
    manifests, spec = _test(options.test, deployment)
    png, answer = _snapshot(options, rig, manifests, spec, say)
    width, height = picture_size(png) or (0, 0)
    atomic.write_bytes(picture, png)
    if not rig.is_emulated:
        return (
            f"{picture}: a snapshot of {width} x {height} pixels; mark its objects, and save them as {output} in COCO"
        )
    boxes = [
        (1, (str(box["class"]), (box["x"], box["y"], box["width"], box["height"]))) for box in answer.get("boxes", ())
    ]
    if not boxes:
        raise UsageError("the camera sees no object of the scene")
    images = [{"id": 1, "file_name": picture.name, "width": width, "height": height}]
    atomic.write_text(output, DataSet(images, boxes).text({name for _, (name, _) in boxes}))
    return f"{output}: {len(boxes)} boxes in {width} x {height} pixels; {picture} shows the scene"


def _test(word: str | None, deployment: Deployment) -> tuple[Mapping[str, Manifest], Spec | None]:
    """The services, and the one test that a word names; its other problems do not matter here."""
    if word is None:
        return load_manifests(deployment.services)[0], None
    checked = selection.select([word], (), [])
    tests = {of_test(spec).title: spec for spec in checked.specs}
    if len(tests) != 1:
        raise UsageError(f"--test {word} matches {len(tests)} tests, expected one: {', '.join([*tests][:3])} ...")
    return checked.manifests, checked.specs[0]


def _snapshot(
    options: argparse.Namespace,
    rig: Rig,
    manifests: Mapping[str, Manifest],
    spec: Spec | None,
    say: Callable[[str], None],
) -> tuple[bytes, dict[str, Any]]:
    """The bytes of the picture, and the answer of the camera's program."""
    snapshot = access.snapshot(rig, manifests, spec)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "snapshot.png"
        words = [*snapshot.words, f"--output={path}"]
        words += [f"--truth-classes={options.classes}"] if snapshot.is_rendered and options.classes else []
        with access.occupied(rig.cid, "'dodo rig truth'", devices_in(words), say, options.wait) as query:
            answer = query((snapshot.program, words))
        if answer.get("reason"):
            say(f"warning: {answer['reason']}")
        return path.read_bytes(), answer
