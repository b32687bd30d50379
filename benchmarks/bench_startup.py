"""How soon short commands of DoDo end from a cold start, beside ruff, pytest and docker compose.

Everything is called in turns within one run. Elapsed seconds are what one waits for; on a busy machine they say as much
of the others there as of the program, so that the seconds of a processor are measured, too. "Cold" means a new process:
files may be in the system's cache, and Python's bytecode is, as after any earlier call.
"""

import shutil
import statistics
import sys
from pathlib import Path
from typing import NamedTuple

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # this checkout

from players import ROOT, Cost, cost_of

from benchmarks.ledger.budget import Budget
from benchmarks.ledger.row import Goal, Row, cost_row, plan, report

ROUNDS = 15
BIN = Path(sys.executable).parent
CHECKED = ROOT / "dodo_dsl" / "compiler.py"
OURS = {"--help": ("--help",), "list": ("list",), "compile --check": ("compile", "--check", "-o", "build/absent")}
GOALS = {"--help": 0.2, "list": 0.4, "compile --check": 0.4}
"""Elapsed seconds on an idle machine."""
PEERS = {
    "ruff --version": ("ruff", "--version"),
    "ruff check": ("ruff", "check", "--no-cache", str(CHECKED)),
    "pytest --version": ("pytest", "--version"),
    "docker compose version": ("docker", "compose", "version"),
}
BESIDE = {"--help": ("pytest --version", "docker compose version", "ruff --version"),
          "list": ("pytest --version", "docker compose version"),
          "compile --check": ("ruff check", "pytest --version", "docker compose version")}  # fmt: skip
"""The peers of each command; the first stands in the row with the goal."""


class Found(NamedTuple):
    """What each program took in each round."""

    ours: dict[str, list[Cost]]
    peers: dict[str, list[Cost]]


def program(name: str) -> str | None:
    """That beside this Python, or else of the path."""
    own = BIN / name
    return str(own) if own.is_file() else shutil.which(name)


def rows(found: Found) -> list[Row]:
    """For each command the seconds that pass beside each peer, and those of a processor beside the first one."""
    made = []
    for command, costs in found.ours.items():
        own = [cost.seconds for cost in costs]
        beside = [name for name in BESIDE[command] if found.peers.get(name)]
        goal = Goal(GOALS[command], of="value")
        if not beside:
            made.append(cost_row(f"dodo {command}", "s", own, goal=goal, note="none of the peers is installed"))
        for index, name in enumerate(beside):
            theirs = [cost.seconds for cost in found.peers[name]]
            words = f"dodo {command}" if index == 0 else f"dodo {command}, beside {name}"
            made.append(cost_row(words, "s", own, name, theirs, goal=None if index else goal))
        made.append(cost_row(f"dodo {command}, processor", "s", [cost.processor for cost in costs]))
    return made


def main() -> int:
    budget = Budget.given()
    commands = {name: [path, *words[1:]] for name, words in PEERS.items() if (path := program(words[0]))}
    found = Found({name: [] for name in OURS}, {name: [] for name in commands})
    plan(*rows(found))
    for name in list(commands):
        try:
            cost_of(commands[name], ROOT)  # and fills the system's cache
        except RuntimeError as error:
            print(f"{name} is left out: {error}")
            del commands[name], found.peers[name]
    for words in OURS.values():
        cost_of([sys.executable, "-m", "dodo_dsl", *words], ROOT)
    for _ in budget.rounds(ROUNDS):
        for name, command in commands.items():
            found.peers[name].append(cost_of(command, ROOT))
        for name, words in OURS.items():
            found.ours[name].append(cost_of([sys.executable, "-m", "dodo_dsl", *words], ROOT))
        report(*rows(found))
    for name, costs in (*((f"dodo {words}", costs) for words, costs in found.ours.items()), *found.peers.items()):
        seconds, processor = ([getattr(c, key) * 1000 for c in costs] for key in ("seconds", "processor"))
        print(f"{name:24s} {statistics.median(seconds):6.0f} ms, at best {min(seconds):6.0f};"
              f" processor {statistics.median(processor):6.0f} ms, at best {min(processor):6.0f}")  # fmt: skip
    return 0


if __name__ == "__main__":
    sys.exit(main())
