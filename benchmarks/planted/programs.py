"""How many real drives dodo search needs until it finds a planted bug, and whether it reduces it to its causes.

    python benchmarks/planted/programs.py [BUG...] [--seed 0] [--most 400] [--first] [--work build/planted]

Each bug of bugs.py gets a folder with the example application, whose steering has it, and a test with seven ranges.
`dodo search --until-failure` drives there until it finds a failure, and reduces it; the test that it writes is then
driven ten times. Random drives would need 0.693 / volume of them as the median, as a drive outside the corner passes.
With --first, a search is interrupted at its failure, before it is reduced, so that many seeds take less time.
"""

import argparse
import json
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
sys.path.insert(0, str(HERE))

from bugs import BUGS  # noqa: E402

DODO = [str(Path(sys.executable).parent / "dodo")]
TIMES = 10


def prepare(bug: str, folder: Path) -> None:
    """A repository with the bug's test and application."""
    tests = folder / "tests"
    shutil.copytree(ROOT / "tests_registry" / "maps", tests / "maps", dirs_exist_ok=True)
    shutil.copytree(ROOT / "tests_registry" / "sil-closed-straight", tests / "sil-closed-straight", dirs_exist_ok=True)
    spec = (HERE / "planted.dodo.yml").read_text().replace("BUG: none", f"BUG: {bug}")
    (tests / "planted").mkdir(exist_ok=True)
    (tests / "planted" / "planted.dodo.yml").write_text(spec)
    (folder / "dodo.yml").write_text("dodo: 1\nregistry: [tests]\napplication: docker-compose.yml\n")
    example = ROOT / "examples" / "kiwi"
    for source, target in (
        ("perception.py", "perception.py"),
        ("steering.py", "driver.py"),
        ("docker-compose.yml",) * 2,
    ):
        shutil.copy(example / source, folder / target)
    for name in ("steering.py", "bugs.py"):
        shutil.copy(HERE / name, folder / name)


def dodo(folder: Path, *words: str) -> str:
    """What the command printed; its exit code is for pipelines."""
    done = subprocess.run(
        [*DODO, *words], cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False
    )
    if done.returncode not in (0, 1):
        raise SystemExit(f"{folder.name}: dodo {' '.join(words)} ended with {done.returncode}\n{done.stdout}")
    return done.stdout


def first_failure(found: dict[str, Any]) -> int | None:
    numbers = [one["worst"]["number"] for one in found["failures"]]
    return min(numbers, default=None)


def again(folder: Path, spec: str, reason: str) -> str:
    """How many of ten drives of a test that the search wrote fail, and whether for its reason."""
    dodo(folder, "run", spec, "--repeat", str(TIMES), "--report", "again")
    results = json.loads((folder / "again" / "results.json").read_text())
    ends = [one for one in results["tests"] if one["outcome"] == "failed"]
    same = sum(one["reason"] == reason for one in ends)
    return f"{len(ends)} of {TIMES}, {same} with its sentence"


def kept(folder: Path) -> list[tuple[int, str]]:
    """Numbers and outcomes of the drives that a search has kept so far, in order."""
    store = folder / "dodo-report" / "search" / "planted" / "search.journal"
    lines = [json.loads(line) for line in store.read_text().splitlines()] if store.exists() else []
    drives = [line["user_attrs"]["drive"] for line in lines if "drive" in line.get("user_attrs", ())]
    return sorted((drive["number"], drive["outcome"]) for drive in drives)


def first_of(bug: str, work: Path, seed: int, most: int) -> str:
    """A search that ends at its first failure."""
    folder = work / f"{bug}-{seed}"
    prepare(bug, folder)
    words = ["search", "planted", "--runs", str(most), "--seed", str(seed), "--until-failure"]
    begin = time.monotonic()
    with subprocess.Popen([*DODO, *words], cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as search:
        number = None
        while number is None and search.poll() is None:
            time.sleep(1)
            failed = [one for one, outcome in kept(folder) if outcome == "failed"]
            number = min(failed, default=None)
        search.send_signal(signal.SIGINT)
    drives = kept(folder)
    number = min((one for one, outcome in drives if outcome == "failed"), default=None)
    return row(bug, number, len(drives), time.monotonic() - begin)


def row(bug: str, number: int | None, drives: int, seconds: float) -> str:
    volume = BUGS[bug].volume if bug in BUGS else 0.0
    random = f"{0.693 / volume:.0f}" if volume else ""
    first = str(number) if number else f"none in {drives}"
    return f"{bug:<14}  {volume:6.2%}  {first:>13}  {random:>6}  {seconds:6.0f} s"


def measure(bug: str, work: Path, seed: int, most: int) -> str:
    folder = work / f"{bug}-{seed}"
    prepare(bug, folder)
    begin = time.monotonic()
    words = [] if bug == "none" else ["--until-failure", "--save"]
    dodo(folder, "search", "planted", "--runs", str(most), "--seed", str(seed), *words)
    seconds = time.monotonic() - begin
    found = json.loads((folder / "dodo-report" / "search" / "planted" / "search.json").read_text())
    drives = found["judged"] + found["proposed"] + found["errors"]
    number = first_failure(found)
    shrunk = found["shrunk"][0] if found["shrunk"] else None
    changed = [name.upper() for name in shrunk["changed"]] if shrunk else []
    corner = set(BUGS[bug].corner) if bug in BUGS else set()
    foreign = sorted(set(changed) - corner)
    verdict = again(folder, shrunk["spec"], shrunk["reason"]) if shrunk and shrunk["spec"] else ""
    return "  ".join(
        [
            row(bug, number, drives, seconds),
            f"{','.join(changed).lower():<32}",
            "foreign: " + ",".join(foreign) if foreign else "",
            verdict,
        ]
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=re.split(r"\n\n", __doc__ or "")[0])
    parser.add_argument("bugs", nargs="*", metavar="BUG", help="of bugs.py, or none (default: all of bugs.py)")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--most", type=int, default=400)
    parser.add_argument("--first", action="store_true", help="reduce nothing")
    parser.add_argument("--work", type=Path, default=ROOT / "build" / "planted")
    flags = parser.parse_args()
    one = first_of if flags.first else measure
    print("bug             volume  first failure  random    search  shrunk to                         its test, again")
    for bug in flags.bugs or BUGS:
        print(one(bug, flags.work.resolve(), flags.seed, flags.most), flush=True)


if __name__ == "__main__":
    main()
