"""dodo rig truth: a snapshot of a rig's camera, and its truth for object-detection."""

import argparse
import tempfile
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from dodo_dsl.atomic import refuse_existing
from dodo_dsl.cli import selection
from dodo_dsl.cli.numbers import patience
from dodo_dsl.rec import truth
from dodo_dsl.rec.truth import Mark, TruthError, TruthFiles, decoded, given
from dodo_dsl.run.rigs import access
from dodo_dsl.run.rigs.leases import devices_in
from dodo_dsl.spec.deployment import Deployment
from dodo_dsl.spec.load import of_test
from dodo_dsl.spec.manifest import Manifest, load_manifests
from dodo_dsl.spec.model import Spec
from dodo_dsl.spec.rig import Rig

SUMMARY = "take a snapshot of the camera and write its truth for object-detection"
EXAMPLES = """examples:
  dodo rig truth emulated --test hil-camera --classes cone_yellow=yellow,cone_blue=blue -o truths/board.json
                                        the boxes of the virtual scene that the test's camera sees
  dodo rig truth kiwi-static -o truths/desk.json
                                        only a snapshot, truths/desk.png, to see where objects are
  dodo rig truth kiwi-static -o truths/desk.json --picture truths/desk.png \\
      --box yellow 199 329 36 55 --box blue 440 347 43 67
                                        the truth of that snapshot, with boxes marked manually

It writes FILE.json (COCO, in pixels), FILE.png (the snapshot) and FILE-boxes.png, which shows the boxes: look at it.
"""


def add(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("rig", metavar="RIG", help="name of a rig in dodo.yml, or emulated")
    parser.add_argument("-o", "--output", metavar="FILE.json", type=Path, required=True, help="truth file to write")
    parser.add_argument("--test", metavar="TEST", help="test whose camera is used; required for the emulated rig")
    parser.add_argument("--box", nargs=5, action="append", default=[], metavar=("CLASS", "X", "Y", "WIDTH", "HEIGHT"),
                        help="a box in pixels from the upper left corner; repeatable")  # fmt: skip
    parser.add_argument("--classes", metavar="A,B", default="", help="known classes, as MODEL=CLASS for a virtual "
                        "scene (default: those that the test judges, else any)")  # fmt: skip
    parser.add_argument("--picture", metavar="FILE", type=Path, help="picture to use instead of a new snapshot")
    parser.add_argument("--force", action="store_true", help="replace existing files")
    parser.add_argument(
        "--wait", type=patience, default=60.0, metavar="S", help="maximum wait for a busy rig, in s (default: 60)"
    )


def make(options: argparse.Namespace, deployment: Deployment, rig: Rig, say: Callable[[str], None]) -> str:
    """Writes truth and pictures; a sentence about them.

    Raises TruthError, OutputExists, RigProblem and LeaseTimeout.
    """
    files = TruthFiles.beside(options.output)
    manifests, spec = _test(options.test, deployment)
    is_new = options.picture is None or options.picture.resolve() != files.picture.resolve()
    is_scene = rig.is_emulated and not options.box
    has_boxes = is_scene or options.box
    refuse_existing(files.wanted(bool(has_boxes), is_new), options.force)
    marks = [truth.mark(words[0], words[1:], f"--box {' '.join(words)}") for words in options.box]
    png, answer = _looked(options, rig, manifests, spec, say)
    picture = decoded(png, str(options.picture or rig.name))
    height, width = picture.shape[:2]
    marks += [_of_scene(box) for box in answer.get("boxes", ())] if is_scene else []
    classes = [word.partition("=")[2] or word for word in options.classes.split(",") if word]
    classes = classes or (access.judged_classes(rig, manifests, spec) if spec else [])
    if is_scene and classes and not options.classes:
        _require_names(marks, classes)
    truth.check(marks, width, height, classes)
    if has_boxes and not marks:
        raise TruthError("no boxes, expected at least one")
    files.write(picture, marks, is_new)
    return _sentence(files, marks, width, height)


def _test(word: str | None, deployment: Deployment) -> tuple[Mapping[str, Manifest], Spec | None]:
    """The services, and the one test that a word names; its other problems do not matter here."""
    if word is None:
        return load_manifests(deployment.services)[0], None
    checked = selection.select([word], (), [])
    tests = {of_test(spec).title: spec for spec in checked.specs}
    if len(tests) != 1:
        raise TruthError(f"--test {word} matches {len(tests)} tests, expected one: {', '.join([*tests][:3])} ...")
    return checked.manifests, checked.specs[0]


def _looked(
    options: argparse.Namespace,
    rig: Rig,
    manifests: Mapping[str, Manifest],
    spec: Spec | None,
    say: Callable[[str], None],
) -> tuple[bytes, dict[str, Any]]:
    """The bytes of the picture, and the answer of the camera's program."""
    if options.picture:
        if rig.is_emulated and not options.box:
            raise TruthError("--picture has no virtual scene: mark its boxes with --box")
        return given(options.picture), {}
    snapshot = access.snapshot(rig, manifests, spec)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "snapshot.png"
        words = [*snapshot.words, f"--output={path}"]
        words += [f"--truth-classes={options.classes}"] if snapshot.is_rendered and "=" in options.classes else []
        with access.occupied(rig.cid, "'dodo rig truth'", devices_in(words), say, options.wait) as query:
            answer = query((snapshot.program, words))
        if answer.get("reason"):
            say(f"warning: {answer['reason']}")
        return path.read_bytes(), answer


def _require_names(marks: Sequence[Mark], classes: Sequence[str]) -> None:
    """The models of a scene have their own names unless --classes maps them to classes."""
    strange = next((each.label for each in marks if each.label not in classes), "")
    if strange:
        expected = f"the test judges {', '.join(classes)}"
        raise TruthError(f"the scene has '{strange}', and {expected}: write --classes {strange}=CLASS,...")


def _of_scene(box: dict[str, Any]) -> Mark:
    return truth.mark(box["class"], [box[name] for name in ("x", "y", "width", "height")], "the virtual scene")


def _sentence(files: TruthFiles, marks: Sequence[Mark], width: int, height: int) -> str:
    if not marks:
        how = f"mark boxes with --picture {files.picture} --box CLASS X Y WIDTH HEIGHT"
        return f"{files.picture}: a snapshot of {width} x {height} pixels; {how}"
    counts = Counter(mark.label for mark in marks)
    classes = ", ".join(f"{count} {label}" for label, count in sorted(counts.items()))
    boxes = f"{len(marks)} box{'es' * (len(marks) > 1)}"
    return f"{files.truth}: {boxes} ({classes}) in {width} x {height} pixels; look at {files.marked}"
