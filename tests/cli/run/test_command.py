"""``dodo run`` as users meet it: a real command on compiled tests of small scripts."""

import json
import os
import signal
import socket
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import pytest

from dodo_dsl.opendlv.bus.address import group
from tests.run.desk import ROOT, Desk, gone, marks, processes_with, wait_for
from tests.run.helpers import FAIL, PASS, READY, WAIT


@pytest.fixture
def desk(tmp_path: Path) -> Desk:
    return Desk(tmp_path)


def test_passes_with_exit_code_0(desk: Desk) -> None:
    process = desk.start(desk.bench.plan())
    out, _ = process.communicate(timeout=30)
    assert process.returncode == 0, out
    assert "PASSED  test  it drove (set-up " in out
    assert "1 passed, 0 failed, 0 in error" in out
    (test,) = desk.results()
    assert test["outcome"] == "passed"
    assert [s["name"] for s in test["services"]] == ["camera", "judge", "app"]  # type: ignore[attr-defined]
    assert (desk.folder / "report" / "test" / "logs" / "application.app.log").is_file()


def test_fails_with_exit_code_1_and_a_junit_failure(desk: Desk) -> None:
    process = desk.start(desk.bench.plan(judge=READY + FAIL))
    out, _ = process.communicate(timeout=30)
    assert process.returncode == 1, out
    case = ElementTree.parse(desk.folder / "report" / "junit.xml").find(".//testcase")
    assert case is not None
    assert (case.get("classname"), case.get("name"), case.get("file")) == ("sil", "test", "test/test.dodo.yml")
    failure = case.find("failure")
    assert failure is not None
    assert failure.get("message") == "hit wall left"
    assert (desk.folder / "report" / "metrics.txt").read_text().endswith("# EOF\n")
    assert "hit wall left" in (desk.folder / "report" / "index.html").read_text()


def test_letters_that_the_terminal_lacks_cost_no_verdict(desk: Desk) -> None:
    desk.environment["PYTHONIOENCODING"] = "ascii"
    process = desk.start(desk.bench.plan(judge=READY + PASS.replace("it drove", "it turned 5\\\\u00b0 and")))
    out, _ = process.communicate(timeout=30)
    assert process.returncode == 0, out
    assert "PASSED  test  it turned 5? and" in out


def test_losses_of_messages_are_noted_below_the_test(desk: Desk) -> None:
    lost = 'print(\'{"dodo": "lost", "messages": 5}\', flush=True)\n'
    process = desk.start(desk.bench.plan(judge=READY + lost + "time.sleep(0.3)\n" + PASS))
    out, _ = process.communicate(timeout=30)
    note = "service 'judge' lost 5 messages, as its receive buffer was full: its verdict is about the others"
    assert (process.returncode, f"        note: {note}\n" in out) == (0, True), out
    assert desk.results()[0]["notes"] == [note]


def test_error_has_exit_code_3_and_is_a_junit_error(desk: Desk) -> None:
    process = desk.start(desk.bench.plan(judge=READY))
    process.communicate(timeout=30)
    assert process.returncode == 3
    case = ElementTree.parse(desk.folder / "report" / "junit.xml").find(".//testcase")
    assert case is not None
    assert case.find("error") is not None


@pytest.mark.parametrize("isolation", ["network", "host"])
def test_interrupt_takes_everything_down_and_still_reports(desk: Desk, isolation: str) -> None:
    process = desk.start(desk.bench.plan(judge=READY + WAIT), "--isolation", isolation)
    wait_for(process, "running")
    process.send_signal(signal.SIGINT)
    out, _ = process.communicate(timeout=30)
    assert process.returncode == 130, out
    assert "Traceback" not in out
    (test,) = desk.results()
    assert (test["outcome"], test["reason"]) == ("error", "the run was interrupted")
    assert gone(marks(desk))


def test_interrupt_during_teardown_keeps_the_verdict(desk: Desk) -> None:
    stubborn = "import signal\nsignal.signal(signal.SIGTERM, signal.SIG_IGN)\n" + WAIT
    process = desk.start(desk.bench.plan(application=stubborn))
    wait_for(process, "taking down")
    process.send_signal(signal.SIGINT)
    out, _ = process.communicate(timeout=30)
    assert process.returncode == 130, out
    (test,) = desk.results()
    assert (test["outcome"], test["reason"]) == ("passed", "it drove")
    assert gone(marks(desk))


def test_reader_that_leaves_does_not_end_the_run(desk: Desk) -> None:
    process = desk.start(desk.bench.plan())
    assert process.stdout is not None
    process.stdout.readline()
    process.stdout.close()
    assert process.wait(30) == 0
    (test,) = desk.results()
    assert test["outcome"] == "passed"


def test_report_among_tests_is_refused_and_harms_nothing(desk: Desk) -> None:
    process = desk.start(desk.bench.plan(), report="generated")
    out, _ = process.communicate(timeout=30)
    assert process.returncode == 2
    assert "holds tests; name another folder with --report" in out
    assert (desk.folder / "generated" / "test" / "test.json").is_file()


@pytest.mark.parametrize(
    "change",
    [{"slug": "../../x"}, {"timeout_s": "1"}, {"cid": 999}, {"seed": -1}, {"services": 3}, {"application": {}}],
    ids=str,
)
def test_tampered_compiled_tests_are_refused(desk: Desk, change: dict[str, object]) -> None:
    folder = desk.compiled(desk.bench.plan())
    raw = json.loads((folder / "test.json").read_text())
    (folder / "test.json").write_text(json.dumps({**raw, **change}))
    command = [sys.executable, "-m", "dodo_dsl", "run", "--compiled", str(folder)]
    environment = {**desk.environment, "PYTHONPATH": str(ROOT)}
    result = subprocess.run(command, cwd=desk.folder, env=environment, capture_output=True, text=True, check=False)
    assert result.returncode == 2
    assert "not a compiled test" in result.stderr


def test_foreign_traffic_is_refused_with_its_sender(desk: Desk) -> None:
    plan = replace(desk.bench.plan(), cid=231)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
        stranger.connect(group(231))
        port = stranger.getsockname()[1]
        process = desk.start(plan, "--isolation", "host")
        while process.poll() is None:
            stranger.send(b"\x0d\xa4\x00\x00\x00")
            time.sleep(0.02)
    out, _ = process.communicate()
    assert process.returncode == 3, out
    (test,) = desk.results()
    assert test["outcome"] == "error"
    assert f":{port}; end it" in str(test["reason"])


def test_kept_test_stays_until_it_is_taken_down(desk: Desk) -> None:
    process = desk.start(desk.bench.plan(), "--keep")
    out, _ = process.communicate(timeout=30)
    assert process.returncode == 0, out
    assert processes_with(marks(desk))
    (pid,) = [line.rpartition(" ")[2] for line in out.splitlines() if line.startswith("take it down: kill ")]
    other = desk.start(desk.bench.plan(slug="other"), report="other")
    assert other.communicate(timeout=30)[0]
    assert processes_with(marks(desk)), "the next run takes no kept test down"
    os.kill(int(pid), signal.SIGTERM)
    assert gone(marks(desk))


def test_usage_errors_are_sentences(desk: Desk) -> None:
    for words, said in (
        (["--compiled", "nowhere"], "there is no compiled test at 'nowhere': No such file or directory"),
        (["no-such-test"], "there is no test 'no-such-test'"),
        (["--application", "none.yml"], "there is no file 'none.yml', expected the application's compose file"),
        (["a/b.dodo.yml"], "there is no test at"),
        (["--seed", "-1"], "'-1' is no whole number from 0 to 4294967295"),
        (["-j", "0"], "'0' is no whole number of 1 or more"),
    ):
        environment = {**desk.environment, "PYTHONPATH": str(ROOT)}
        command = [sys.executable, "-m", "dodo_dsl", "run", *words]
        result = subprocess.run(command, cwd=desk.folder, env=environment, capture_output=True, text=True, check=False)
        assert result.returncode == 2, result
        assert said in result.stderr
        assert "Traceback" not in result.stderr


def test_times_of_all_runs_are_kept_and_drawn(desk: Desk) -> None:
    """A second run forecasts what the first one took, and the report shows both."""
    first = desk.start(desk.bench.plan())
    said_first, _ = first.communicate()
    assert "; at most " in said_first
    second = desk.start(desk.bench.plan())
    said, _ = second.communicate()
    assert "; about " in said
    assert (desk.folder / "report" / "times.png").read_bytes().startswith(b"\x89PNG")
    assert 'src="times.png"' in (desk.folder / "report" / "index.html").read_text()
