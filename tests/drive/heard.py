"""What a listener beside the example application hears in each shipped test."""

import re
import shutil
from collections.abc import Iterable
from pathlib import Path

import yaml

from tests.drive.applications import ROOT, dodo, kiwi, results

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


def strangers(names: Iterable[str]) -> list[str]:
    """Of what was heard, that which neither a car nor DoDo's own exchange has."""
    return [name for name in names if not name.startswith(CAR)]
