"""Where and how a command is started does not matter: cases of several conditions, each drives a few centimetres."""

import contextlib
import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import pytest
import yaml

from tests.drive.applications import ROOT, results
from tests.ordinary_user import USER, words_as_user

pytestmark = pytest.mark.slow

TINY = Path(__file__).parent / "tiny"
"""A repository with one test, which takes no longer than it must."""

RUN = ("run", "sil-tiny", "-q", "--report", "{report}")
OUTSIDE = ("run", "{checkout}/tests/sil-tiny", "-q", "--report", "{report}")
NOT_UTF8 = "caf\udce9"
"""The bytes of a name, as Python has them."""


@dataclass(frozen=True)
class Case:
    """A command of ``words`` in the folder ``at``.

    ``{scratch}`` is a folder for the case, in which ``place`` is the ``{checkout}``, ``made`` as it says; ``{report}``
    is what ``report`` names, seen from ``at``. A value of None removes a variable. ``says`` is in the output.
    """

    name: str
    place: str = "checkout"
    made: str = "copy"
    at: str = "{checkout}"
    words: tuple[str, ...] = RUN
    report: str = "dodo-report"
    umask: int = 0o022
    is_user: bool = False
    environment: Mapping[str, str | None] = field(default_factory=dict)
    code: int = 0
    says: str = ""


ODD = "-a b#c%20d%'\"`$HOME${b}$(c){{d}}{%e:,=\\n\n[b]*?<i>&amp;größe"
IN_ASCII = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
CASES = (
    Case(
        "odd path in ASCII, umask 077 of a user, no HOME, TMPDIR",
        ODD,
        umask=0o077,
        is_user=True,
        environment={**IN_ASCII, "HOME": None, "TMPDIR": "{scratch}/tmp"},
    ),
    Case(
        "deep subfolder of a symlink, report above, locale C, umask 077, memories of POSIX, HOME and TMPDIR missing",
        "größe",
        made="symlink",
        at="{checkout}/tests/sil-tiny",
        report="../../dodo-report",
        umask=0o077,
        environment={
            "LC_ALL": "C",
            "CLUON_SHAREDMEMORY_POSIX": "1",
            "HOME": "{scratch}/missing",
            "TMPDIR": "{scratch}/missing",
        },
    ),
    Case(
        "outside, report in the application's folder, umask 027 of a user, HOME read-only, TMPDIR relative",
        at="{scratch}",
        words=OUTSIDE,
        report="checkout/out",
        umask=0o027,
        is_user=True,
        environment={"HOME": "/usr", "TMPDIR": "."},
    ),
    Case(
        "read-only checkout of a user, report outside, HOME and XDG folders read-only, TMPDIR in memory",
        made="read-only",
        report="{scratch}/a/b",
        is_user=True,
        environment={"HOME": "/proc", "XDG_STATE_HOME": "/proc/a", "XDG_CACHE_HOME": "/proc/b", "TMPDIR": "/dev/shm"},
    ),
    Case("not UTF-8 in ASCII", NOT_UTF8, environment=IN_ASCII, code=2, says="/caf\\xe9' is not UTF-8"),
)


@pytest.fixture
def scratch() -> Iterator[Path]:
    """A folder that everybody may enter and write into, outside the ``/tmp`` that tests have for themselves."""
    folder = Path(tempfile.mkdtemp(prefix="dodo-tests-", dir="/var/tmp"))
    folder.chmod(0o777)
    yield folder
    subprocess.run(["chmod", "-R", "u+w", str(folder)], check=True)
    shutil.rmtree(os.fsencode(folder))


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_it_passes(case: Case, scratch: Path) -> None:
    with checkout_of(case, scratch) as checkout:
        started(case, scratch, checkout)


def test_it_passes_below_tmp() -> None:
    """Each test has a ``/tmp`` of its own, through which its application has to get to its folder."""
    folders = {"XDG_STATE_HOME": "{scratch}/st ate", "XDG_CACHE_HOME": "{scratch}/ca che"}
    case = Case("below /tmp", umask=0o077, environment=folders)
    scratch = tempfile.TemporaryDirectory(prefix="dodo-tests-", dir="/tmp")
    with scratch as name, checkout_of(case, Path(name)) as checkout:
        started(case, Path(name), checkout)


@contextlib.contextmanager
def checkout_of(case: Case, scratch: Path, **service: object) -> Iterator[Path]:
    """The repository as the case has it, owned by who runs it; ``service`` are keys of the application's."""
    checkout, as_root = scratch / case.place, os.getuid() == 0
    before = os.umask(case.umask)
    try:
        lay_out(checkout, **service)
        (scratch / "tmp").mkdir()
    finally:
        os.umask(before)
    if case.made == "symlink":
        (scratch / "link").symlink_to(checkout)
        checkout = scratch / "link"
    if case.is_user and as_root:
        subprocess.run(["chown", "-hR", str(USER), str(scratch)], check=True)
    if case.made == "read-only":
        subprocess.run(["chmod", "-R", "a-w", str(checkout)], check=True)
    mounted = case.made == "read-only" and as_root
    if mounted:
        subprocess.run(["mount", "--bind", "-o", "ro", str(checkout), str(checkout)], check=True)
    try:
        yield checkout
    finally:
        if mounted:
            subprocess.run(["umount", str(checkout)], check=True)


def lay_out(checkout: Path, **service: object) -> None:
    for source in filter(Path.is_file, TINY.rglob("*")):
        target = checkout / source.relative_to(TINY)
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_bytes(source.read_bytes())
    if service:
        path = checkout / "docker-compose.yml"
        compose = yaml.safe_load(path.read_text(encoding="utf-8"))
        compose["services"]["ahead"] |= service
        path.write_text(yaml.safe_dump(compose), encoding="utf-8")


def started(case: Case, scratch: Path, checkout: Path, *more: str) -> None:
    """Runs the case's command, with ``more`` words, and looks at what it printed, wrote and left."""
    known = {"scratch": str(scratch), "checkout": str(checkout), "report": ""}

    def filled(text: str) -> str:
        for name, value in known.items():
            text = text.replace(f"{{{name}}}", value)
        return text

    folder, known["report"] = filled(case.at), filled(case.report)
    kept = {k: v for k, v in os.environ.items() if not k.startswith(("DODO_", "PYTHON", "LC_", "LANG", "XDG_"))}
    wanted = {"HOME": str(scratch), "PYTHONPATH": str(ROOT), **case.environment}
    environment = {**kept, **{name: filled(value) for name, value in wanted.items() if value is not None}}
    if wanted["HOME"] is None:
        environment.pop("HOME", None)
    who = words_as_user(scratch) if case.is_user and os.getuid() == 0 else []
    command = [*who, sys.executable, "-m", "dodo_dsl", *map(filled, case.words), *more]
    done = subprocess.run(
        command, cwd=folder, env=environment, umask=case.umask, capture_output=True, check=False, timeout=200
    )
    output = (done.stdout + done.stderr).decode(errors="replace")
    assert done.returncode == case.code, output
    assert "Traceback" not in output
    assert case.says in output
    if case.words[0] == "run" and case.code == 0:
        passed(Path(folder, known["report"]))
    assert list((scratch / "tmp").iterdir()) == []


def passed(report: Path) -> None:
    (test,) = results(report).values()
    assert (test["outcome"], test["reason"]) == ("passed", "reached finish after 0.42 s")
    for log in (report / "sil-tiny" / "logs").iterdir():
        if not log.name.startswith("application."):  # which may be about to look at a picture at the end
            assert "Traceback" not in log.read_text(encoding="utf-8", errors="replace")
    for name in ("trajectory.png", "drive.html", "test.rec"):
        assert (report / "sil-tiny" / name).is_file(), name
    json.loads((report / "results.json").read_bytes())
