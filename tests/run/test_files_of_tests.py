"""Files of tests are found wherever they lie, and nothing else is."""

import os
from collections.abc import Sequence
from pathlib import Path

import pytest

from dodo_dsl.run import application_files as module
from dodo_dsl.run.application_files import MOST_HIDDEN, MOST_IN_FOLDER, files_of_tests, in_few

REPORT, PLAN, MAP = '{\n  "dodo": "results",', '{\n  "dodo": "plan",', '{"model": []}'
SPEC = """\
dodo: 1
environment:
  camera: {uses: virtual-camera, with: {map: ../maps/straight}}
evaluation:
  boxes: {uses: object-detection, with: {truth: "../truths/a.json", title: not/there.json}}
  lane: {uses: x, with: {target: ../targets/a.csv, truth: '../truths/${matrix.x}-b.json', map: "../maps/${matrix.x}"}}
  speed: {uses: x, with: {limits: "${matrix.x}/${matrix.y}", all: "../data/${matrix.x}"}}
application:
  env: {MODEL: ../model.json}
"""
OURS = {
    "earlier/results.json": REPORT, "earlier/index.html": "", "earlier/sil/test.rec": "",
    "earlier/sil/logs/app.log": "", "elsewhere/sil/test.json": PLAN, "elsewhere/sil/files/map.png": "",
    "cups/one/sil-first.dodo.yml": SPEC, "cups/one/README.md": "", "cups/maps/straight/map.json": MAP,
    "cups/truths/a.json": "[]", "cups/targets/a.csv": "", "cups/truths/1-b.json": "", "cups/maps/1/map.json": MAP,
    "cups/maps/1/a.bin": "", "mixed/map.json": MAP, "data/drive.rec": "", "kept/cal.rec": "",
    "car/sil-mine.dodo.yml": SPEC, "now/.next-12ab/x/log": "",
}  # fmt: skip
OWN = {
    "steering.py": "", "car/drive.py": "", "cups/model.json": "[]", "maps/map.json": '{"roads": []}',
    "model.json": "[]", "other/results.json": "{}", "other/test.json": "{}", "README.md": "", "notes/plan.yml": "",
    "data/x/weights.bin": "", "models/map.json": '{"model": "yolo"}', "models/weights.bin": "", "kept/cal.yml": "",
    "layers/map.json": '{"model": [{"name": "conv"}]}', "layers/weights.bin": "", "cups/data/calibration.json": "",
    "mixed/app.py": "", "car/x/y.json": "", "cups/truths/c.json": "",
}  # fmt: skip


def make(folder: Path, *tables: dict[str, str]) -> None:
    for name, text in {k: v for table in tables for k, v in table.items()}.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)


def seen(folder: Path, hidden: Sequence[Path]) -> set[str]:
    files = (Path(top, name) for top, _, names in os.walk(folder) for name in names)
    return {str(file.relative_to(folder)) for file in files if not {file, *file.parents} & set(hidden)}


def test_all_of_tests_and_nothing_else(tmp_path: Path) -> None:
    make(tmp_path, OURS, OWN)
    assert seen(tmp_path, files_of_tests(tmp_path, tmp_path).paths) == set(OWN)


@pytest.mark.parametrize("own", [".", "car"])
def test_a_registry_that_is_the_applications_folder_or_holds_it(tmp_path: Path, own: str) -> None:
    """A report and a compiled test may be written there, too."""
    mixed = {"results.json": REPORT, "sil/test.rec": "", "sil/drive.js": "", "test.json": PLAN, "a.rec": "", "a.py": ""}
    make(tmp_path / "car", mixed, {"sil-a.dodo.yml": "map: road\n", "road/map.json": "{}", "lib/b.py": ""})
    hidden = files_of_tests(tmp_path, tmp_path / own).paths
    assert not {tmp_path, tmp_path / own} & set(hidden)
    if own == "car":
        assert seen(tmp_path / "car", hidden) == {"a.py", "lib/b.py"}


def test_of_an_environment_only_dodos_own_tests_are_looked_for(tmp_path: Path) -> None:
    data = ".venv/lib/python3.11/site-packages/dodo_dsl/_data"
    make(tmp_path, {".venv/pyvenv.cfg": "", f"{data}/a.dodo.yml": SPEC, f"{data}/../../other/b.rec": ""})
    assert list(files_of_tests(tmp_path, tmp_path).paths) == [tmp_path / data]


def test_links_and_what_is_no_file_are_passed_by(tmp_path: Path) -> None:
    (tmp_path / "loop").symlink_to(".")
    (tmp_path / "gone.rec").symlink_to("nowhere")
    os.mkfifo(tmp_path / "results.json")
    os.mkfifo(tmp_path / "a.dodo.yml")
    assert list(files_of_tests(tmp_path, tmp_path).paths) == []


def test_too_many_folders_are_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    make(tmp_path, {"a/a.py": "", "b/b.rec": ""})
    assert files_of_tests(tmp_path, tmp_path).problem == ""
    module.forget()
    monkeypatch.setattr(module, "MOST_FOLDERS", 2)
    assert "holds more than 2 folders" in files_of_tests(tmp_path, tmp_path).problem


def test_a_folder_is_searched_once_in_a_run(tmp_path: Path) -> None:
    before = files_of_tests(tmp_path, tmp_path)
    make(tmp_path, {"b/b.rec": ""})
    assert files_of_tests(tmp_path, tmp_path) is before
    module.forget()
    assert files_of_tests(tmp_path, tmp_path).paths == (tmp_path / "b",)


def test_many_files_are_hidden_with_their_folder_but_not_with_the_applications() -> None:
    own = Path("/app")
    many = [Path(f"/app/data/{n}.rec") for n in range(MOST_IN_FOLDER + 1)]
    few = [Path(f"/app/{n}.rec") for n in range(MOST_IN_FOLDER + 1)]
    assert in_few([*many, *few], own) == [*few, Path("/app/data")]
    assert in_few(many[1:], own) == many[1:]
    with pytest.raises(ValueError, match=r"2,900 files .* in '/app', and a sandbox hides at most 1,000 .*registry"):
        in_few([Path(f"/app/{n}.rec") for n in range(2_900)], own)
    with pytest.raises(ValueError, match="65,536 bytes"):
        in_few([Path(f"/app/{'a' * 200}{n}.rec") for n in range(MOST_HIDDEN // 2)], own)
