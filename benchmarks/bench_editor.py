"""How soon ``dodo lsp`` answers an editor, in a repository with 100 tests, beside yaml-language-server.

The tests are copies of the shipped ones, with their matrices and with what they extend. A client of the protocol opens
one, makes a mistake and fixes it again, and saves each text: it is answered when the problems are shown, or shown to be
gone. The peer is what editors otherwise check a test with: it knows the schema alone, and one file at a time, where
``dodo lsp`` checks wiring, maps and all other tests, too. The peer waits 0.2 s for the next key, which is part of its
figures, as an editor's user waits for it, too.
"""

import shutil
import statistics
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # this checkout

import numpy as np

from benchmarks.ledger.budget import Budget
from benchmarks.ledger.row import Goal, Row, cost_row, plan, report
from tests.lsp.editor import ROOT, Editor, Message, editor

SERVER = "yaml-language-server"
OWN = ROOT / "build" / "bench" / "node" / "node_modules" / ".bin" / SERVER
"""Where scripts/install-bench-tools puts it."""
PEER = str(OWN) if OWN.is_file() else shutil.which(SERVER)
NO_PEER = f"{SERVER} is not installed (scripts/install-bench-tools, with npm)"
TESTS, ROUNDS, KEYS = 100, 5, 10
GOAL = Goal(0.2, of="value")
OPENED = "sil-closed-straight-1"
MISTAKE = ("timeout: 60 s", "timeot: 60 s")
KEY, LATE = "problems after a save", "problems after a save, 95 %"


def write_registry(folder: Path) -> Path:
    """A repository with so many specs; the result is the one to open."""
    shutil.copytree(ROOT / "tests_registry", folder / "tests")
    shutil.copytree(ROOT / "examples" / "kiwi", folder / "kiwi")
    shutil.copytree(ROOT / "schemas", folder / "schemas")
    shipped = sorted((ROOT / "tests_registry").glob("*/*.dodo.yml"))
    for index in range(TESTS - len(shipped)):
        spec, number = shipped[index % len(shipped)], 1 + index // len(shipped)
        old, name = spec.parent.name, f"{spec.parent.name}-{number}"
        path = folder / "tests" / name / f"{name}.dodo.yml"
        path.parent.mkdir()
        path.write_text(spec.read_text().replace(f"name: {old}\n", f"name: {name}\n"))
    (folder / "dodo.yml").write_text("dodo: 1\nregistry: [tests]\napplication: kiwi/docker-compose.yml\n")
    assert len(list((folder / "tests").glob("*/*.dodo.yml"))) == TESTS
    return folder / "tests" / OPENED / f"{OPENED}.dodo.yml"


class Session:
    """An open test in an editor; ``texts`` are it with a mistake and without."""

    def __init__(self, one: Editor, path: Path) -> None:
        self.editor, self.path = one, path
        text = path.read_text()
        self.texts = (text.replace(*MISTAKE), text)
        assert self.texts[0] != text
        document = {"uri": path.as_uri(), "languageId": "yaml", "version": 0, "text": text}
        one.send(method="textDocument/didOpen", params={"textDocument": document})
        self.key()
        self.key()  # what is loaded once is loaded now

    def key(self) -> float:
        """Seconds until the mistake is shown, or until it is gone, in turns."""
        is_wrong = self.texts[0] != getattr(self, "shown", None)
        self.shown = self.texts[0] if is_wrong else self.texts[1]

        def answers(message: Message) -> bool:
            params = message.get("params") or {}
            about = message.get("method") == "textDocument/publishDiagnostics" and params["uri"] == self.path.as_uri()
            return about and bool(params["diagnostics"]) == is_wrong

        begin = time.perf_counter()
        self.editor.type(self.path, self.shown)
        self.editor.until(answers)
        return time.perf_counter() - begin


@contextmanager
def peer(folder: Path, path: Path) -> Iterator[Session]:
    """The YAML language server, with DoDo's schema, which the first line of the test names."""
    assert PEER
    with editor(folder, command=(PEER, "--stdio")) as one:
        settings = {"yaml": {"validate": True, "schemaStore": {"enable": False}}}
        one.send(method="workspace/didChangeConfiguration", params={"settings": settings})
        yield Session(one, path)


Times = dict[str, list[float]]


def measure(session: Session, times: Times) -> None:
    """One round: some keys."""
    times.setdefault(KEY, []).extend(session.key() for _ in range(KEYS))


def late(values: Sequence[float]) -> list[float]:
    return [float(np.percentile(values, 95))] if values else []


def rows(ours: Times, theirs: Times) -> list[Row]:
    """A row for each kind of wait; every value of ours has one of the peer's, if it has an answer at all."""
    made = []
    for name in (KEY, LATE):
        pair = [late(times.get(KEY, ())) if name == LATE else times.get(name, []) for times in (ours, theirs)]
        beside = (SERVER, pair[1]) if pair[1] else ()
        made.append(cost_row(f"editor, {name}", "s", pair[0], *beside, goal=GOAL, note="" if theirs else NO_PEER))
    return made


def compare(folder: Path) -> None:
    path, budget = write_registry(folder), Budget.given()
    ours: Times = {}
    theirs: Times = {}
    with editor(folder) as one:
        session = Session(one, path)
        if PEER is None:
            _rounds(budget, [(session, ours)], ours, theirs)
            return
        with peer(folder, path) as other:
            _rounds(budget, [(session, ours), (other, theirs)], ours, theirs)


def _rounds(budget: Budget, sessions: Sequence[tuple[Session, Times]], ours: Times, theirs: Times) -> None:
    for number in budget.rounds(ROUNDS):
        for session, times in sessions if number % 2 else reversed(sessions):
            measure(session, times)
        report(*rows(ours, theirs))
    for whose, times in (("ours", ours), ("peer", theirs)):
        if values := times.get(KEY):
            middle, end = statistics.median(values) * 1000, late(values)[0] * 1000
            print(f"{KEY} {whose}: {middle:6.0f} ms, 95 % {end:6.0f} ms, of {len(values)}")


def main() -> int:
    plan(*rows({}, {}))
    with tempfile.TemporaryDirectory() as name:
        compare(Path(name).resolve())
    return 0


if __name__ == "__main__":
    sys.exit(main())
