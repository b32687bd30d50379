"""The faults around a test that scripts cause, with what they lead to, and a column for each backend.

``make test`` has on each backend what only that one can show; all of them are for ``make proof``.
"""

from collections.abc import Callable, Mapping
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
MAYBE = """print('{"dodo": "verdict", "outcome": "maybe"}', flush=True)\n"""
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
SHORT, LONG = "make test", "make proof"


@dataclass(frozen=True)
class Fault:
    """Scripts that cause a fault, and how the sentence about it begins; ``name`` is the one on the page.

    ``at`` has where it is tried, by backend; ``app`` are keys of the application's service in a compose file.
    """

    name: str
    outcome: str
    sentence: str
    at: Mapping[str, str]
    judge: str = READY + WAIT
    application: str = WAIT
    environment: str = READY + WAIT
    app: Mapping[str, Any] = field(default_factory=dict)


NEIGHBOUR = Fault(
    "",
    "passed",
    "it drove",
    {"process": SHORT, "docker": SHORT, "mixed": SHORT},
    judge=DRIVES,
    application=SHARES + WAIT,
)
FAULTS = {
    "neighbour": NEIGHBOUR,
    "killed": Fault(
        "The application is killed",
        "failed",
        "application service 'app' was killed by SIGKILL after",
        {"process": SHORT, "docker": SHORT, "mixed": LONG},
        application=SHARES + "time.sleep(0.5)\nos.kill(os.getpid(), 9)",
    ),
    "hungry": Fault(
        "The application takes more memory than it may",
        "failed",
        "application service 'app' ran out of memory after ",
        {"docker": SHORT, "mixed": SHORT},
        application=HUNGRY,
        app={"mem_limit": "64m", "memswap_limit": "64m"},
    ),
    "hungry-child": Fault(
        "A child of the application takes more memory than it may",
        "failed",
        "application service 'app' ran out of memory after ",
        {"docker": SHORT, "mixed": LONG},
        application="if os.fork() == 0:\n    " + HUNGRY.strip().replace("\n", "\n    ") + "\n" + WAIT,
        app={"mem_limit": "64m", "memswap_limit": "64m"},
    ),
    "service-killed": Fault(
        "A service of DoDo's is killed",
        "error",
        "service 'camera' of layer environment was killed by SIGKILL after",
        {"process": SHORT, "docker": LONG, "mixed": LONG},
        environment=READY + BEGUN + "os.kill(os.getpid(), 9)",
    ),
    "no-verdict": Fault(
        "An evaluator ends without a verdict",
        "error",
        "evaluator 'judge' ended without a verdict after",
        {"process": SHORT, "docker": LONG, "mixed": LONG},
        judge=READY + BEGUN,
    ),
    "two-verdicts": Fault(
        "An evaluator gives two verdicts",
        "error",
        "evaluator 'judge' gave 2 verdicts, expected one",
        {"process": SHORT, "docker": LONG},
        judge=READY + BEGUN + PASS + FAIL,
    ),
    "malformed": Fault(
        "An evaluator gives a malformed verdict",
        "error",
        "the verdict of evaluator 'judge' is malformed: Invalid enum value 'maybe' - at `$.outcome`, expected passed or "
        "failed",
        {"process": SHORT, "docker": LONG},
        judge=READY + BEGUN + MAYBE + WAIT,
    ),
    "many-lines": Fault(
        "The application logs 10,000 lines a second",
        "passed",
        "it drove",
        {"process": SHORT, "docker": LONG},
        judge=READY + BEGUN + "time.sleep(2)\n" + PASS,
        application=LINES_A_SECOND,
    ),
    "long-line": Fault(
        "The application logs a line of 5 MB",
        "passed",
        "it drove",
        {"process": SHORT, "docker": SHORT},
        judge=READY + LONG_LINE + BEGUN + PASS,
        application=LONG_LINE + 'print("after")\n' + WAIT,
    ),
    "ends": Fault(
        "",
        "failed",
        "application service 'app' ended with exit code 0",
        {"docker": LONG},
        application="sys.exit(0)\n",
    ),
    "ends-early": Fault(
        "",
        "failed",
        "application service 'app' ended with exit code 7",
        {"docker": LONG},
        application="sys.exit(7)\n",
    ),
    "no-program": Fault(
        "",
        "error",
        "service 'app' could not be started: ",
        {"docker": SHORT},
        app={"entrypoint": ["no-such-program"], "init": False},
    ),
    "missing": Fault(
        "An image is missing",
        "error",
        f"image {MISSING} cannot be pulled: ",
        {"docker": SHORT},
        app={"image": MISSING},
    ),
}


def faults_on(backend: str) -> list[Any]:
    """The faults on a backend, as parameters: those of ``make test``, and all, if that has not got them all."""
    every = {slug: fault for slug, fault in FAULTS.items() if backend in fault.at}
    short = {slug: fault for slug, fault in every.items() if fault.at[backend] == SHORT}
    long = [pytest.param(every, id="all", marks=pytest.mark.proof)] if short != every else []
    return [pytest.param(short, id="few" if long else "all"), *long]


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
    line = log("long-line")
    assert (len(line), line[-7:]) == (5_000_007, "\nafter\n")
