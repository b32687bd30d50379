"""Modules of the firmware include one another without circles."""

import re
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

from tests.firmware.programs import ROOT

FIRMWARE = ROOT / "firmware"
ROOTS = ("gantry", "emulator")
"""Folders of ``firmware/`` that includes are relative to, as its Makefile has them."""
INCLUDE = re.compile(r'^\s*#\s*include\s+"([^"]+)"', re.MULTILINE)


def module(path: Path) -> str:
    """X.c, X.h and X_internal.h are one module."""
    return str(path.with_suffix("")).removesuffix("_internal")


def graph(firmware: Path) -> dict[str, set[str]]:
    """What each module includes; raises LookupError where an include names no file."""
    found: dict[str, set[str]] = {}
    for root in ROOTS:
        for path in sorted((firmware / root).rglob("*.[ch]")):
            name = module(path.relative_to(firmware))
            found.setdefault(name, set())
            for include in INCLUDE.findall(path.read_text(encoding="utf-8")):
                files = [Path(one, include) for one in ROOTS if (firmware / one / include).is_file()]
                if len(files) != 1:
                    raise LookupError(f"{path} includes {include}, which names {len(files)} files")
                found[name] |= {module(files[0])} - {name}
    return found


def order(firmware: Path) -> list[str]:
    """Modules after those that they include; raises CycleError where there is no such order."""
    return list(TopologicalSorter(graph(firmware)).static_order())


def test_modules_include_one_another_without_circles() -> None:
    modules = order(FIRMWARE)
    assert modules.index("emulator/telemetry") < modules.index("emulator/plant/plant")
    assert modules.index("gantry/drivers/rig") < modules.index("gantry/supervision/supervision")


def tree(folder: Path, files: dict[str, str]) -> Path:
    for name, text in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text, encoding="utf-8")
    return folder


@pytest.mark.parametrize("part", ["gantry/a.c", "gantry/a.h", "gantry/a_internal.h"])
def test_a_circle_is_found_through_each_part_of_a_module(tmp_path: Path, part: str) -> None:
    files = {"gantry/a.h": "", "gantry/b.h": '#include "a.h"\n', part: '#include "b.h"\n'}
    with pytest.raises(CycleError, match="gantry/a"):
        order(tree(tmp_path, files))


def test_a_circle_between_folders_is_found(tmp_path: Path) -> None:
    files = {"gantry/x/a.h": "", "gantry/x/a.c": '#  include "y/b.h"\n', "emulator/y/b.h": '#include "x/a.h"\n'}
    with pytest.raises(CycleError):
        order(tree(tmp_path, files))


def test_an_include_that_names_no_file_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(LookupError, match=r"includes gone\.h, which names 0 files"):
        order(tree(tmp_path, {"emulator/a.c": '#include "gone.h"\n'}))
