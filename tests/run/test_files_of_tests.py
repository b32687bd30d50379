"""Files of tests are found wherever they lie, and nothing else is."""

import os
from pathlib import Path

import pytest

from dodo_dsl.run.files_of_tests import files_of_tests

REPORT, PLAN, MAP = '{\n  "dodo": "results",', '{\n  "dodo": "plan",', '{"model": []}'
SPEC = """\
dodo: 1
environment:
  camera: {uses: virtual-camera, with: {map: ../maps/straight}}
evaluation:
  boxes: {uses: object-detection, with: {truth: "../truths/a.json", title: not/there.json}}
application:
  env: {MODEL: ../model.json}
"""
OURS = {
    "earlier/results.json": REPORT, "earlier/index.html": "", "earlier/sil/test.rec": "",
    "earlier/sil/logs/app.log": "", "elsewhere/sil/test.json": PLAN, "elsewhere/sil/files/map.png": "",
    "cups/one/sil-first.dodo.yml": SPEC, "cups/one/README.md": "", "cups/maps/straight/map.json": MAP,
    "cups/truths/a.json": "[]", "data/drive.rec": "", "car/sil-mine.dodo.yml": SPEC, "now/.next-12ab/x/log": "",
}  # fmt: skip
OWN = {
    "steering.py": "", "car/drive.py": "", "cups/model.json": "[]", "maps/map.json": '{"roads": []}',
    "model.json": "[]", "other/results.json": "{}", "other/test.json": "{}", "README.md": "", "notes/plan.yml": "",
    "data/x/weights.bin": "",
}  # fmt: skip


def make(folder: Path, *tables: dict[str, str]) -> None:
    for name, text in {k: v for table in tables for k, v in table.items()}.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)


def seen(folder: Path, hidden: list[Path]) -> set[str]:
    files = (Path(top, name) for top, _, names in os.walk(folder) for name in names)
    return {str(file.relative_to(folder)) for file in files if not {file, *file.parents} & set(hidden)}


def test_all_of_tests_and_nothing_else(tmp_path: Path) -> None:
    make(tmp_path, OURS, OWN)
    assert seen(tmp_path, files_of_tests(tmp_path, tmp_path)) == set(OWN)


@pytest.mark.parametrize("own", [".", "car"])
def test_a_registry_that_is_the_applications_folder_or_holds_it(tmp_path: Path, own: str) -> None:
    """A report and a compiled test may be written there, too."""
    mixed = {"results.json": REPORT, "sil/test.rec": "", "sil/drive.js": "", "test.json": PLAN, "a.rec": "", "a.py": ""}
    make(tmp_path / "car", mixed, {"sil-a.dodo.yml": "map: road\n", "road/map.json": "{}", "lib/b.py": ""})
    hidden = files_of_tests(tmp_path, tmp_path / own)
    assert not {tmp_path, tmp_path / own} & set(hidden)
    if own == "car":
        assert seen(tmp_path / "car", hidden) == {"a.py", "lib/b.py"}


def test_of_an_environment_only_dodos_own_tests_are_looked_for(tmp_path: Path) -> None:
    data = ".venv/lib/python3.11/site-packages/dodo_dsl/_data"
    make(tmp_path, {".venv/pyvenv.cfg": "", f"{data}/a.dodo.yml": SPEC, f"{data}/../../other/b.rec": ""})
    assert files_of_tests(tmp_path, tmp_path) == [tmp_path / data]


def test_links_and_what_is_no_file_are_passed_by(tmp_path: Path) -> None:
    (tmp_path / "loop").symlink_to(".")
    (tmp_path / "gone.rec").symlink_to("nowhere")
    os.mkfifo(tmp_path / "results.json")
    os.mkfifo(tmp_path / "a.dodo.yml")
    assert files_of_tests(tmp_path, tmp_path) == []
