"""Where and how a command is started does not matter: a table of cases, each of which drives a few centimetres.

``make test`` has several conditions in one case; each by itself, which tells what matters, is for ``make proof``.
"""

import contextlib
import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

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


def of_locale(locale: str, mode: str | None) -> Case:
    environment = {"LC_ALL": locale, "PYTHONUTF8": mode, "PYTHONCOERCECLOCALE": "0"}
    return Case(f"locale {locale}, UTF-8 mode {mode}", "größe", environment=environment)


FOLDERS = (
    Case("a subfolder", at="{checkout}/tests"),
    Case("a deep subfolder, report above", at="{checkout}/tests/sil-tiny", report="../../dodo-report"),
    Case("outside, report beside", at="{scratch}", words=OUTSIDE),
    Case("outside, report in the application's folder", at="{scratch}", words=OUTSIDE, report="checkout/out"),
    Case("report outside", report="{scratch}/a/b"),
    Case("read-only checkout", made="read-only", report="{scratch}/out"),
    Case("read-only checkout of a user", made="read-only", report="{scratch}/out", is_user=True),
    Case("worktree", made="worktree"),
    Case("symlink", made="symlink"),
    Case("subfolder of a symlink", made="symlink", at="{checkout}/tests"),
    Case("compiled from a subfolder", at="{checkout}/tests", words=("compile", "-o", "{report}")),
    Case("compiled elsewhere", words=("compile", "-o", "{report}"), report="{scratch}/generated"),
    Case("a new test from a subfolder", at="{checkout}/tests", words=("new", "sil-more")),
)
USERS = (
    Case("umask 077", umask=0o077),
    Case("umask 077, memories of POSIX", umask=0o077, environment={"CLUON_SHAREDMEMORY_POSIX": "1"}),
    Case("umask 027", umask=0o027),
    Case("umask 022 of a user", is_user=True),
    Case("umask 077 of a user", umask=0o077, is_user=True),
    Case("umask 027 of a user", umask=0o027, is_user=True),
)
LOCALES = (of_locale("C", None), *(of_locale(name, mode) for name in ("C", "POSIX", "C.UTF-8") for mode in "01"))
PATHS = (
    Case("blank, number sign and percent", "a b#c%20d%"),
    Case("quotes", "a'b\"c`"),
    Case("dollar and braces", "a$HOME${b}$(c){{d}}{%e"),
    Case("colon, comma and equals", "a:b,c=d"),
    Case("backslash and line break", "a\\nb\nc"),
    Case("pattern and tag", "a[b]*?<i>&amp;"),
    Case("dash", "-a"),
    Case("not UTF-8", NOT_UTF8, code=2, says="/caf\\xe9' is not UTF-8"),
    Case("not UTF-8 in ASCII", NOT_UTF8, environment={"LC_ALL": "C", "PYTHONUTF8": "0"}, code=2, says="is not UTF-8"),
    Case("report not UTF-8", report=NOT_UTF8),
)
FOLDERS_OF_USERS = (
    Case("no HOME", environment={"HOME": None}),
    Case("HOME missing", environment={"HOME": "{scratch}/missing"}),
    Case("HOME read-only", environment={"HOME": "/proc"}),
    Case("HOME relative", environment={"HOME": "relative"}),
    Case("HOME not UTF-8", environment={"HOME": f"{{scratch}}/{NOT_UTF8}"}),
    Case("no HOME of a user", environment={"HOME": None}, is_user=True),
    Case("HOME read-only of a user", environment={"HOME": "/usr"}, is_user=True),
    Case("XDG folders", environment={"XDG_STATE_HOME": "{scratch}/st ate", "XDG_CACHE_HOME": "{scratch}/ca che"}),
    Case("XDG folders read-only", environment={"XDG_STATE_HOME": "/proc/a", "XDG_CACHE_HOME": "/proc/b"}),
    Case("TMPDIR", environment={"TMPDIR": "{scratch}/tmp"}),
    Case("TMPDIR of a user", environment={"TMPDIR": "{scratch}/tmp"}, is_user=True),
    Case("TMPDIR missing", environment={"TMPDIR": "{scratch}/missing"}),
    Case("TMPDIR relative", environment={"TMPDIR": "."}),
    Case("TMPDIR in memory", environment={"TMPDIR": "/dev/shm"}),
    Case("TMPDIR in memory of a user", environment={"TMPDIR": "/dev/shm"}, is_user=True),
    Case("TMPDIR among the tests", environment={"TMPDIR": "{checkout}/tests"}),
    Case("TMPDIR not UTF-8", environment={"TMPDIR": f"{{scratch}}/{NOT_UTF8}"}),
)
ONE_BY_ONE = (*FOLDERS, *USERS, *LOCALES, *PATHS, *FOLDERS_OF_USERS)
ODD = "-a b#c%20d%'\"`$HOME${b}$(c){{d}}{%e:,=\\n\n[b]*?<i>&amp;größe"
"""All that is odd in ``PATHS``."""
ASCII = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
KNOWN = {case.name: case for case in (*ONE_BY_ONE, Case("odd path", ODD), Case("in ASCII", environment=ASCII))}


def together(*names: str) -> Case:
    """One case with all that several say."""
    cases = [KNOWN[name] for name in names]
    said: dict[str, Any] = {}
    for case in cases:
        said |= {
            each.name: getattr(case, each.name) for each in fields(Case) if getattr(case, each.name) != each.default
        }
    environment = {name: value for case in cases for name, value in case.environment.items()}
    return Case(**{**said, "name": "; ".join(names), "environment": environment})


TOGETHER = (
    together("odd path", "in ASCII", "umask 077 of a user", "no HOME", "TMPDIR"),
    together("symlink", "a deep subfolder, report above", "umask 077, memories of POSIX", "HOME missing"),
    together("outside, report in the application's folder", "umask 027 of a user", "HOME read-only of a user"),
    together(
        "read-only checkout of a user", "report outside", "HOME read-only", "XDG folders read-only", "TMPDIR in memory"
    ),
    together("report not UTF-8", "HOME not UTF-8", "TMPDIR not UTF-8"),
    together(
        "worktree",
        "a subfolder",
        "HOME relative",
        "TMPDIR among the tests",
        "locale POSIX, UTF-8 mode 1",
        "XDG folders",
    ),
    together("not UTF-8 in ASCII"),
    together("odd path", "compiled elsewhere", "a subfolder"),
    together("a new test from a subfolder"),
)


def parameters(together: tuple[Case, ...], one_by_one: tuple[Case, ...], *before: str) -> list[Any]:
    """Cases of ``make test``, and those of ``make proof``, with what is ``before`` each."""
    short = [pytest.param(*before, case, id=" ".join((*before, case.name))) for case in together]
    long = [" ".join((*before, "only", case.name)) for case in one_by_one]
    proof = pytest.mark.proof
    return [*short, *(pytest.param(*before, c, id=i, marks=proof) for c, i in zip(one_by_one, long, strict=True))]


@pytest.fixture
def scratch() -> Iterator[Path]:
    """A folder that everybody may enter and write into, outside the ``/tmp`` that tests have for themselves."""
    folder = Path(tempfile.mkdtemp(prefix="dodo-tests-", dir="/var/tmp"))
    folder.chmod(0o777)
    yield folder
    subprocess.run(["chmod", "-R", "u+w", str(folder)], check=True)
    shutil.rmtree(os.fsencode(folder))


@pytest.mark.parametrize("case", parameters(TOGETHER, ONE_BY_ONE))
def test_it_passes(case: Case, scratch: Path) -> None:
    with checkout_of(case, scratch) as checkout:
        started(case, scratch, checkout)


def test_it_passes_below_tmp() -> None:
    """Each test has a ``/tmp`` of its own, through which its application has to get to its folder."""
    case = Case("below /tmp", umask=0o077)
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
    if case.made == "worktree":
        git = ["git", "-c", "user.name=a", "-c", "user.email=a@example.org", "-C", str(checkout)]
        for words in (["init", "-q"], ["add", "."], ["commit", "-qm", "a"], ["worktree", "add", "-q", "../tree"]):
            subprocess.run([*git, *words], check=True)
        checkout = scratch / "tree"
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
