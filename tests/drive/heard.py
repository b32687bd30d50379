"""What a listener beside the example application hears in each shipped test, and the documentation's table of that."""

import json
import re
import shutil
from collections.abc import Iterable, Mapping
from pathlib import Path

import yaml

from tests.drive.applications import ROOT, dodo, kiwi, results

RECORD = Path(__file__).with_suffix(".json")
"""By clock and test: the messages that are none of the application's own. ``scripts/make-heard`` writes it."""
PAGE = ROOT / "docs" / "reference" / "applications.md"
BEGIN, END = "<!-- the table of scripts/make-heard begins -->", "<!-- and ends -->"
CAR = ("opendlv.proxy.", "opendlv.system.", "opendlv.device.")
"""What a car's bus carries."""
TESTS = sorted(path.name.partition(".")[0] for path in ROOT.glob("tests_registry/*/*.dodo.yml"))
TESTS_IN = {"lockstep": [name for name in TESTS if not name.startswith("hil-")], "realtime": TESTS}

Heard = dict[str, list[str]]


def application(folder: Path) -> Path:
    """The example application with the listener, and the file that starts it."""
    path = kiwi(folder / "listened")
    shutil.copy(ROOT / "tests" / "drive" / "listener.py", path.parent)
    compose = yaml.safe_load(path.read_text())
    compose["services"]["listener"] = compose["services"]["perception"] | {
        "command": "python /listener.py --cid=111",
        "entrypoint": [],
        "volumes": ["./listener.py:/listener.py:ro"],
        "x-dodo": {"out": []},
        "x-dodo-process": ["sh", "-c", "exec python listener.py --cid=111"],
    }
    path.write_text(yaml.safe_dump(compose))
    return path


def heard(folder: Path, clock: str, tests: Iterable[str], *words: str) -> Heard:
    """What is heard in shipped tests, with ``words`` for dodo run; the listener hears the application for sure."""
    path, report = application(folder), folder / "report"
    given = ("--clock", clock, "--application", str(path), "--report", str(report), *words)
    dodo("run", *tests, *given, code=(0, 1, 3))
    services = yaml.safe_load(path.read_text())["services"].values()
    own = {word for service in services for word in service["x-dodo"]["out"]}
    found: dict[str, set[str]] = {}
    for slug, test in results(report).items():
        log = (report / slug / "logs" / "application.listener.log").read_text()
        names = set(re.findall(r"^heard (\S+)$", log, re.MULTILINE))
        assert names, (slug, test["reason"])
        others = {name for name in names if name not in own and name.removesuffix("/0") not in own}
        found.setdefault(slug.partition("--")[0], set()).update(others)
    return {name: sorted(others) for name, others in sorted(found.items())}


def strangers(found: Mapping[str, Iterable[str]]) -> dict[str, list[str]]:
    """Of what was heard, that which neither a car nor DoDo's own exchange has, by test."""
    named = {test: [n for n in names if not n.startswith(CAR)] for test, names in found.items()}
    return {test: names for test, names in named.items() if names}


def read() -> dict[str, Heard]:
    """The record by clock."""
    return json.loads(RECORD.read_text())


def page() -> str:
    """The documentation's page with the table of the record."""
    record = read()
    rows = [f"| `{test}` | {_cell(record['lockstep'], test)} | {_cell(record['realtime'], test)} |" for test in TESTS]
    table = "\n".join(["| test | in lockstep | in real time |", "|---|---|---|", *rows])
    text = PAGE.read_text()
    return f"{text[: text.index(BEGIN)]}{BEGIN}\n{table}\n{text[text.index(END) :]}"


def _cell(found: Heard, test: str) -> str:
    if test not in found:
        return ""
    return ", ".join(f"`{name}`" for name in found[test]) or "nothing"
