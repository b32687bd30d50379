"""Labels for the frames of a recording that do not come from its messages."""

from collections.abc import Mapping
from pathlib import Path

from dodo_dsl.opendlv.messages.varints import Numbers
from dodo_dsl.opendlv.recordings.recording import Recording
from dodo_dsl.rec import truth
from dodo_dsl.rec.coco import Detection


def of_truth(recording: Recording, images: Numbers, path: Path) -> Mapping[int, list[Detection]]:
    """The boxes of a truth file for each image message, as of a rig where nothing moves; raises TruthError."""
    (width, height), marks = truth.load(path)
    truth.check(marks, width, height, ())
    if not marks:
        raise truth.TruthError(f"{path}: has no boxes")
    boxes = [(m.label, (m.x / width, m.y / height, m.width / width, m.height / height)) for m in marks]
    found = [Detection(box, label) for label, box in boxes]
    return dict.fromkeys((e.sample_time for e in recording.envelopes(images)), found)
