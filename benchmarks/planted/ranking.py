"""Whether dodo rank puts twelve faulty applications and the good one in the order in which they are known to be.

    python benchmarks/planted/ranking.py [--samples 16] [--work build/planted/ranking]

graded.py plants four kinds of mistakes into the example's steering, each in three grades. All thirteen applications
drive the same samples of sil-closed-straight's ranges, whose goals are the time and the distance to the walls. The good
one is expected first, of each kind the higher grade not above the lower one, and what crashes last.
"""

import argparse
import itertools
import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
sys.path.insert(0, str(HERE))

DODO = str(Path(sys.executable).parent / "dodo")
KINDS, GRADES = ("weak", "slow", "aside", "crash"), (1, 2, 3)
TEAMS = ("good", *(f"{kind}-{grade}" for kind in KINDS for grade in GRADES))
SPEC = """\
dodo: 1
name: graded
extends: ../sil-closed-straight/sil-closed-straight.dodo.yml
application: {env: {FAULT: %s}}
"""


def drive(team: str, folder: Path, samples: int) -> None:
    """The samples of one application, with their report in its folder."""
    tests = folder / "tests"
    for name in ("maps", "sil-closed-straight"):
        shutil.copytree(ROOT / "tests_registry" / name, tests / name, dirs_exist_ok=True)
    (tests / "graded").mkdir(exist_ok=True)
    (tests / "graded" / "graded.dodo.yml").write_text(SPEC % team)
    (folder / "dodo.yml").write_text("dodo: 1\nregistry: [tests]\napplication: docker-compose.yml\n")
    example = ROOT / "examples" / "kiwi"
    for source, target in (("perception.py", "perception.py"), ("steering.py", "driver.py")):
        shutil.copy(example / source, folder / target)
    shutil.copy(example / "docker-compose.yml", folder / "docker-compose.yml")
    shutil.copy(HERE / "graded.py", folder / "steering.py")
    words = [DODO, "run", "graded", "--samples", str(samples), "-q"]
    done = subprocess.run(words, cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode not in (0, 1):
        raise SystemExit(f"{team}: dodo run ended with {done.returncode}\n{done.stdout}{done.stderr}")


def ranking(work: Path) -> str:
    words = [f"{team}={work / team / 'dodo-report'}" for team in TEAMS]
    return subprocess.run([DODO, "rank", *words], capture_output=True, text=True, check=True).stdout


def wrong(work: Path) -> list[str]:
    """What is not in its order."""
    words = [f"{team}={work / team / 'dodo-report'}" for team in TEAMS]
    out = subprocess.run([DODO, "rank", "--format", "json", *words], capture_output=True, text=True, check=True).stdout
    places = {team["team"]: team["rank"] for team in json.loads(out)["teams"]}
    found = [f"{team} is not below good" for team in TEAMS[1:] if places[team] <= places["good"]]
    for kind in KINDS:
        for low, high in itertools.pairwise(f"{kind}-{grade}" for grade in GRADES):
            if places[high] < places[low]:
                found.append(f"{high} is above {low}")
    others = max(place for team, place in places.items() if not team.startswith("crash"))
    return [*found, *(f"{team} is not last" for team in TEAMS if team.startswith("crash") and places[team] < others)]


def main() -> int:
    parser = argparse.ArgumentParser(description=re.split(r"\n\n", __doc__ or "")[0])
    parser.add_argument("--samples", type=int, default=16)
    parser.add_argument("--work", type=Path, default=ROOT / "build" / "planted" / "ranking")
    options = parser.parse_args()
    for team in TEAMS:
        folder = options.work / team
        folder.mkdir(parents=True, exist_ok=True)
        drive(team, folder, options.samples)
        print(team, "driven", file=sys.stderr, flush=True)
    print(ranking(options.work))
    found = wrong(options.work)
    print("\n".join(found) or "all in the known order")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
