"""Every error of a command is one sentence with its name, and an exit code."""

from argparse import Namespace
from io import StringIO
from typing import TextIO

import pytest

from dodo_dsl.atomic import OutputExists
from dodo_dsl.cli import errors
from dodo_dsl.cli.errors import UsageError
from dodo_dsl.cli.main import COMMANDS, main
from dodo_dsl.cli.selection import NoSuchTest
from dodo_dsl.images.docker_command import DockerError
from dodo_dsl.opendlv.odvd import OdvdError
from dodo_dsl.opendlv.recording import RecordingError
from dodo_dsl.opendlv.session import SessionError
from dodo_dsl.plan.plan_json import json_text
from dodo_dsl.plan.test_files import FilesError
from dodo_dsl.report.results import ResultsError
from dodo_dsl.run.leases import LeaseTimeout
from dodo_dsl.run.rigs.problems import RigProblem


def ended(error: BaseException, monkeypatch: pytest.MonkeyPatch, command: str = "list") -> tuple[int, str]:
    """How ``dodo COMMAND`` ends when its work raises this."""

    def work(_options: Namespace, _stdout: TextIO, _stderr: TextIO) -> int:
        raise error

    monkeypatch.setattr(COMMANDS[command].load(), "main", work)
    stdout, stderr = StringIO(), StringIO()
    code = main([command], stdout, stderr)
    assert stdout.getvalue() == ""
    return code, stderr.getvalue()


USAGE = (
    UsageError, NoSuchTest, OdvdError, RecordingError, FilesError, OutputExists,
    ResultsError,
)  # fmt: skip


@pytest.mark.parametrize("kind", USAGE)
def test_errors_of_the_user(kind: type[Exception], monkeypatch: pytest.MonkeyPatch) -> None:
    assert ended(kind("it is so."), monkeypatch) == (2, "dodo list: it is so.\n")


@pytest.mark.parametrize("kind", [DockerError, LeaseTimeout, RigProblem, SessionError])
def test_errors_of_the_machine(kind: type[Exception], monkeypatch: pytest.MonkeyPatch) -> None:
    assert ended(kind("it is so"), monkeypatch, "doctor") == (3, "dodo doctor: it is so\n")


@pytest.mark.parametrize("text", ["caf\udce9/x", 'of: "caf\udce9/x"\nmore: "y"'])
def test_a_name_that_is_not_utf8_is_named(text: str, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(UnicodeEncodeError) as raised:
        json_text({"path": text})
    said = "dodo list: 'caf\\xe9/x' is not UTF-8, as names of files and folders must be here: rename it\n"
    assert ended(raised.value, monkeypatch)[0] == 2
    with pytest.raises(UnicodeEncodeError) as raised:
        text.encode()
    assert ended(raised.value, monkeypatch) == (2, said)


def test_a_rig_says_whose_error_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    assert ended(RigProblem("too far", usage=True), monkeypatch) == (2, "dodo list: too far\n")


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (OSError(28, "No space left on device"), "No space left on device"),
        (OSError(28, "No space left on device", "a/b"), "a/b: No space left on device"),
        (FileNotFoundError(2, "No such file or directory", "a"), "a: No such file or directory"),
        (OSError("odd"), "odd"),
    ],
)
def test_errors_of_the_system(error: OSError, said: str, monkeypatch: pytest.MonkeyPatch) -> None:
    assert ended(error, monkeypatch) == (3, f"dodo list: {said}\n")


def test_what_nobody_foresaw_is_an_internal_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("DODO_DEBUG", raising=False)
    said = "dodo list: internal error: KeyError: 'x'\nDODO_DEBUG=1 shows where\n"
    assert ended(KeyError("x"), monkeypatch) == (3, said)
    monkeypatch.setenv("DODO_DEBUG", "1")
    with pytest.raises(KeyError):
        ended(KeyError("x"), monkeypatch)
    assert ended(UsageError("still a sentence"), monkeypatch) == (2, "dodo list: still a sentence\n")


def test_an_interrupt_has_no_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    assert ended(KeyboardInterrupt(), monkeypatch) == (130, "")


@pytest.mark.parametrize("kind", [FileNotFoundError, IsADirectoryError, NotADirectoryError, PermissionError])
def test_files_that_the_user_names_are_the_users(kind: type[OSError]) -> None:
    with pytest.raises(UsageError, match=r"^a\.rec: refused$"), errors.files_of_the_user():
        raise kind(1, "refused", "a.rec")
    with pytest.raises(OSError, match="full"), errors.files_of_the_user():
        raise OSError(28, "full", "a.rec")
