"""Faults that tests cause by a script, and the outcome of each on the backends where it may differ."""

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import pytest

from dodo_dsl.outcome import Outcome
from tests.faults import Book
from tests.run.helpers import BEGUN, DRIVES, FAIL, PASS, READY, WAIT

SHARES = """
from dodo_dsl.opendlv.shared_memory import SharedMemory
name = sys.argv[2].partition("=")[2]
memory = SharedMemory.create(name, 1000)
print("memory", name, flush=True)
"""
LINES_A_SECOND = """
count, begin = 0, time.monotonic()
while True:
    due = int(10_000 * (time.monotonic() - begin))
    sys.stdout.write("".join(f"{n}\\n" for n in range(count, due)))
    sys.stdout.flush()
    count = due
    time.sleep(0.01)
"""
LONG_LINE = 'print("x" * 5_000_000, flush=True)\n'
HUNGRY = """
held = []
time.sleep(1)
while True:
    held.append(bytearray(os.urandom(1000)) * 4000)
"""
MISSING = "127.0.0.1:9/dodo-no-such-image:1"


@dataclass(frozen=True)
class Fault:
    """Scripts that cause a fault, and how the sentence about it begins; ``name`` is the one on the page.

    ``at`` are the backends on which it is tried; ``app`` are keys of the application's service in a compose file.
    """

    name: str
    outcome: str
    sentence: str
    at: Sequence[str]
    judge: str = READY + WAIT
    application: str = WAIT
    environment: str = READY + WAIT
    app: Mapping[str, Any] = field(default_factory=dict)


NEIGHBOUR = Fault(
    "",
    "passed",
    "it drove",
    ("process", "docker", "mixed"),
    judge=DRIVES,
    application=SHARES + WAIT,
)
FAULTS = {
    "neighbour": NEIGHBOUR,
    "killed": Fault(
        "The application is killed",
        "failed",
        "application service 'app' was killed by SIGKILL after",
        ("process", "docker"),
        application=SHARES + "time.sleep(0.5)\nos.kill(os.getpid(), 9)",
    ),
    "hungry": Fault(
        "The application takes more memory than it may",
        "failed",
        "application service 'app' ran out of memory after ",
        ("docker", "mixed"),
        application=HUNGRY,
        app={"mem_limit": "64m", "memswap_limit": "64m"},
    ),
    "hungry-child": Fault(
        "A child of the application takes more memory than it may",
        "failed",
        "application service 'app' ran out of memory after ",
        ("docker",),
        application="if os.fork() == 0:\n    " + HUNGRY.strip().replace("\n", "\n    ") + "\n" + WAIT,
        app={"mem_limit": "64m", "memswap_limit": "64m"},
    ),
    "service-killed": Fault(
        "A service of DoDo's is killed",
        "error",
        "service 'camera' of layer environment was killed by SIGKILL after",
        ("process",),
        environment=READY + BEGUN + "os.kill(os.getpid(), 9)",
    ),
    "own-verdict": Fault(
        "",
        "passed",
        "it drove",
        ("process",),
        judge=DRIVES,
        application=FAIL + WAIT,
    ),
    "many-lines": Fault(
        "The application logs 10,000 lines a second",
        "passed",
        "it drove",
        ("process", "docker"),
        judge=READY + BEGUN + "time.sleep(2)\n" + PASS,
        application=LINES_A_SECOND,
        app={"tty": True},
    ),
    "long-line": Fault(
        "The application logs a line of 5 MB",
        "passed",
        "it drove",
        ("process", "docker"),
        judge=READY + LONG_LINE + BEGUN + PASS,
        application=LONG_LINE + 'print("after")\n' + WAIT,
    ),
    "no-program": Fault(
        "",
        "error",
        "service 'app' could not be started: ",
        ("docker",),
        app={"entrypoint": ["no-such-program"], "init": False},
    ),
    "missing": Fault(
        "An image is missing",
        "error",
        f"image {MISSING} cannot be pulled: ",
        ("docker",),
        app={"image": MISSING},
    ),
}


NOT_ROOT = pytest.mark.skipif(os.geteuid() != 0, reason="only root enters the network of a container")
MARKS: Mapping[str, list[pytest.MarkDecorator]] = {
    "process": [pytest.mark.slow],
    "docker": [pytest.mark.engine],
    "mixed": [pytest.mark.engine, NOT_ROOT],
}
"""Those of a test on a backend."""


def by_backend() -> list[Any]:
    """Each backend with its faults, as parameters."""
    found = {backend: {slug: fault for slug, fault in FAULTS.items() if backend in fault.at} for backend in MARKS}
    return [pytest.param(backend, faults, id=backend, marks=MARKS[backend]) for backend, faults in found.items()]


def as_told(faults: Mapping[str, Fault], outcomes: Mapping[str, Outcome], backend: str, book: Book) -> None:
    """Each fault leads to its outcome and sentence, which the page has if it names the fault."""
    for slug, fault in faults.items():
        outcome = outcomes[slug]
        assert (outcome.outcome, outcome.reason[: len(fault.sentence)]) == (fault.outcome, fault.sentence), slug
        if fault.name:
            book.record(fault.name, backend, outcome.outcome, outcome.reason)


def whole_logs(faults: Mapping[str, Fault], log: Callable[[str], str]) -> None:
    """Nothing is missing of applications that log much; ``log`` is what that of a slug logged."""
    if "many-lines" in faults:
        numbers = log("many-lines").split("\n")[:-1]
        assert len(numbers) > 10_000
        assert numbers == [str(n) for n in range(len(numbers))]
    if "long-line" in faults:
        line = log("long-line")
        assert (len(line), line[-7:]) == (5_000_007, "\nafter\n")
