"""From findings and verdicts to an outcome, and the sentences about it."""

from dataclasses import replace
from pathlib import Path

import pytest

from dodo_dsl.plan.model import ENDS_INPUT, Application, ApplicationService, Flag
from dodo_dsl.run.outcomes import (
    decide,
    describe,
    how_it_ended,
    unstartable,
)
from dodo_dsl.run.protocol import Finding, VerdictEvent
from tests.run.scripted import plan


def test_verdicts_are_findings() -> None:
    """The first of the worst, of evaluators that which ends the drive; what the engine saw comes before them."""
    good, bad = VerdictEvent("a", True, "fine", ()), VerdictEvent("b", False, "far", ())
    late = VerdictEvent("c", False, "late", ())
    tested = plan(evaluators="abc")
    assert decide(tested, [], {"a": [good], "b": [replace(bad, passed=True)]}).reason == "fine; far"
    said = {"a": [good], "b": [bad], "c": [late]}
    assert decide(tested, [], said) == Finding("failed", "far", "b", cause="verdict")
    ending = replace(tested.services[-1], flags=(Flag(ENDS_INPUT, "true"),))
    until = replace(tested, services=(*tested.services[:-1], ending))
    assert decide(until, [], said).service == "c"
    assert decide(tested, [], {**said, "a": [good, good]}).reason == "evaluator 'a' gave 2 verdicts, expected one"
    assert decide(tested, [Finding("error", "no engine")], {**said, "a": [good, good]}).reason == "no engine"


@pytest.mark.parametrize(
    ("code", "words"),
    [
        (0, "ended with exit code 0"),
        (3, "ended with exit code 3"),
        (128, "ended with exit code 128"),
        (255, "ended with exit code 255"),
        (-9, "was killed by SIGKILL"),
        (137, "was killed by SIGKILL"),
        (-11, "was killed by SIGSEGV"),
        (-63, "was killed by signal 63"),
    ],
)
def test_exit_codes_in_words(code: int, words: str) -> None:
    assert how_it_ended(code) == words


@pytest.mark.parametrize(
    ("program", "why", "hint"),
    [
        ("build/lane", "build/lane: No such file or directory", "; build it first"),
        ("./lane", "./lane: No such file or directory", "; build it first"),
        ("build/lane", "build/lane: Permission denied", ""),
        ("build/lane", "own.env: No such file or directory", ""),
        ("lane", "lane: No such file or directory", ""),
        ("xvfb-run", "xvfb-run: No such file or directory", "; its 'display' needs Xvfb: apt install xvfb xauth"),
        ("/opt/lane", "/opt/lane: No such file or directory", ""),
    ],
)
def test_a_program_that_is_not_there_has_to_be_built(program: str, why: str, hint: str) -> None:
    application = Application(".", (ApplicationService("app", (program, "--fast")),))
    found = unstartable(replace(plan(), application=application), "app", why)
    assert found.reason == f"service 'app' could not be started: {why}{hint}"


def test_a_program_outside_of_what_a_test_sees_has_to_be_named(tmp_path: Path) -> None:
    program = tmp_path / "ros" / "bin" / "python"
    program.parent.mkdir(parents=True)
    (tmp_path / "app").mkdir()
    why = f"{tmp_path}/app/../ros/bin/python: No such file or directory"
    assert "'sandbox: {read: [../ros]}'" not in unstartable(plan(), "app", why).reason
    program.touch()
    assert unstartable(plan(), "app", why).reason.endswith("write 'sandbox: {read: [../ros]}' in dodo.yml")


def test_an_internal_error_leaves_its_traceback(tmp_path: Path) -> None:
    reason = describe(KeyError("a\nb" + "c" * 1000), tmp_path)
    assert reason.startswith("internal error: KeyError: 'a\\nbccc")
    assert reason.endswith("ccc (traceback in logs/runner.log)")
    assert len(reason) < 400
    assert (tmp_path / "logs" / "runner.log").read_text().startswith("KeyError: ")
