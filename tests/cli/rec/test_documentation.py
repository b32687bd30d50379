"""What docs/how-to/recordings.md and the command's help show can be run."""

import json
import re
import shlex
from collections.abc import Callable
from pathlib import Path

import pytest

from dodo_dsl.cli import rec
from tests.rec.conftest import BEGIN, HEIGHT, WIDTH, dodo_rec, message, video

PAGE = (Path(__file__).parents[3] / "docs" / "how-to" / "recordings.md").read_text()
SHOWN = re.findall(r"^ +dodo rec (.*?)(?:  |$)", PAGE + rec.EXAMPLES, re.MULTILINE)


@pytest.mark.parametrize("words", sorted(set(SHOWN)))
@pytest.mark.thorough
def test_the_lines_shown_run(
    words: str, record: Callable[..., Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "own.odvd").write_text("message team.Own [id = 9000] {}")
    second = 1_000_000
    others = [
        message(name, BEGIN + time * second, sender_stamp)
        for time in range(11)
        for name, sender_stamp in (("opendlv.proxy.DistanceReading", 0), ("opendlv.proxy.GroundSteeringRequest", 0))
    ]
    others += [message("opendlv.proxy.GroundSteeringRequest", BEGIN + n * 100_000) for n in range(1, 4)]
    box = [
        message("opendlv.logic.perception.DetectionBoundingBox", BEGIN + 100_000, stamp, width=1, height=1)
        for stamp in (0, 3)
    ]
    for name in ("drive.rec", "old.rec", "desk.rec"):
        record([*video(4), *others, *box], name)
    (tmp_path / "desk.json").write_text(
        json.dumps(
            {
                "images": [{"id": 1, "file_name": "desk.png", "width": WIDTH, "height": HEIGHT}],
                "annotations": [{"id": 1, "image_id": 1, "category_id": 1, "bbox": [1, 2, 3, 4]}],
                "categories": [{"id": 1, "name": "yellow"}],
            }
        )
    )
    if words.startswith("import"):
        assert dodo_rec("export", "drive.rec", "--ros", "-o", "recorded").code == 0
    code, stdout, stderr = dodo_rec(*shlex.split(words))
    assert (code, stderr) == (0, "") and stdout


def test_the_page_names_every_key(record: Callable[..., Path]) -> None:
    path = record([message("opendlv.proxy.DistanceReading", BEGIN)], after=b"?")
    found = json.loads(dodo_rec("info", path, "--json").stdout)
    keys = {*found, *found["messages"][0], *found["frames"], *found["skipped"][0]}
    assert {key for key in keys if f"`{key}`" not in PAGE} == set()
