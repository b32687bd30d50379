"""``dodo run``: what it prints, reports and exits with, on backends that report given events."""

import asyncio
import json
import os
import platform
import re
import signal
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from io import StringIO
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import jsonschema
import pytest
from docker.errors import DockerException, ImageNotFound

from dodo_dsl import __version__, package_data
from dodo_dsl.cli import run
from dodo_dsl.cli import run as cli_run
from dodo_dsl.cli.main import main
from dodo_dsl.outcome import NotRun, Outcome
from dodo_dsl.plan.model import Application, ApplicationService, Plan, PlannedService
from dodo_dsl.plan.plan_json import to_json
from dodo_dsl.report.viewer import page
from dodo_dsl.run.backends import Job
from dodo_dsl.run.protocol import BackendError, Event, Exited, Ready, Time
from dodo_dsl.run.runner import Runner
from tests.cli.terminal import Terminal
from tests.run.scripted import FAILED, PASSED, Events, ScriptedBackend, ScriptedBackends, plan

STARTS: Mapping[str, Events] = {"environment": [(0.0, Ready("camera"))], "evaluation": [(0.0, Ready("track"))]}


def stages(*events: Event) -> dict[str, Events]:
    """Events as soon as the test has begun."""
    return {**STARTS, "begin": [(0.0, event) for event in events]}


ENDINGS = {
    "passed": stages(PASSED, Exited("track", 0)),
    "failed": stages(FAILED, Exited("track", 0)),
    "error": stages(Exited("track", 0)),
}


@dataclass
class Command:
    """``dodo`` in a folder of its own, in this process; tests end as ``stages`` say."""

    folder: Path
    stages: Mapping[str, Events]
    backend: type[ScriptedBackend] = ScriptedBackend

    def compiled(self, tested: Plan) -> Path:
        target = self.folder / "generated" / tested.slug
        target.mkdir(parents=True, exist_ok=True)
        (target / "test.json").write_text(to_json(tested))
        return target

    def run(self, *words: str, tested: Plan | None = None, report: str = "report") -> tuple[int, str, str]:
        """Exit code, standard output and standard error of ``dodo run`` on a compiled test."""
        folder = self.compiled(tested or plan())
        return self.dodo("run", "--compiled", str(folder), "--report", report, *words)

    def dodo(self, *words: str) -> tuple[int, str, str]:
        stdout, stderr = StringIO(), StringIO()
        code = main(words, stdout, stderr)
        assert "Traceback" not in stdout.getvalue() + stderr.getvalue()
        return code, stdout.getvalue(), stderr.getvalue()

    def result(self) -> dict[str, Any]:
        """The one test of the report."""
        document = json.loads((self.folder / "report" / "results.json").read_text())
        jsonschema.validate(document, json.loads((package_data.schemas() / "results.schema.json").read_text()))
        (test,) = document["tests"]
        return dict(test)


@pytest.fixture
def dodo(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Command]:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("DODO_LEASES", str(tmp_path / "leases"))
    monkeypatch.setenv("DODO_HISTORY", str(tmp_path / "history.jsonl"))
    made = Command(tmp_path, ENDINGS["passed"])

    def backends(*_: object) -> ScriptedBackends:
        return ScriptedBackends(lambda tested, _: made.backend(tested, made.stages))

    monkeypatch.setattr(cli_run, "CombinedBackends", backends)
    before = {number: signal.getsignal(number) for number in (signal.SIGTERM, signal.SIGHUP)}
    yield made
    for number, handler in before.items():
        signal.signal(number, handler)


@pytest.mark.parametrize(("ending", "code"), [("passed", 0), ("failed", 1), ("error", 3)])
def test_exit_code_and_counts(dodo: Command, ending: str, code: int) -> None:
    dodo.stages = ENDINGS[ending]
    got, out, _ = dodo.run()
    assert got == code
    counts = {kind: int(kind == ending) for kind in ("passed", "failed", "error")}
    assert "{passed} passed, {failed} failed, {error} in error\n".format(**counts) in out
    assert f"{ending.upper():<6}  test  " in out
    assert dodo.result()["outcome"] == ending


def test_a_second_run_shows_the_first(dodo: Command) -> None:
    assert all("process backend\n" in dodo.run()[1] for _ in range(2))
    assert "2 of 2 passed</dd>" in Path("report/index.html").read_text()


def test_the_report_of_a_test_that_failed(dodo: Command) -> None:
    dodo.stages = ENDINGS["failed"]
    dodo.run()
    case = ElementTree.parse("report/junit.xml").find(".//testcase")
    assert case is not None
    assert (case.get("classname"), case.get("name"), case.get("file")) == ("sil", "test", "test/test.dodo.yml")
    failure = case.find("failure")
    assert failure is not None
    assert failure.get("message") == "hit wall left"
    assert Path("report/metrics.txt").read_text().endswith("# EOF\n")
    assert "hit wall left" in Path("report/index.html").read_text()
    assert [service["name"] for service in dodo.result()["services"]] == ["camera", "track", "app"]


def test_a_verdict_without_room_for_a_report_is_printed(dodo: Command, small_disk: Path) -> None:
    (small_disk / ".gitignore").write_text("*\n")
    (small_disk / "full").write_bytes(bytes(60_000))
    with (small_disk / "fuller").open("wb", buffering=0) as file, pytest.raises(OSError, match="No space left"):
        while True:
            file.write(bytes(512))
    code, out, _ = dodo.run(report=str(small_disk))
    assert code == 3
    assert re.search(r"^PASSED  test .* it drove$", out, re.MULTILINE)
    assert f"'{small_disk}' cannot take the whole report: No space left on device\n" in out


def test_a_report_among_files_of_others_is_refused(dodo: Command, tmp_path: Path) -> None:
    (tmp_path / "other").mkdir()
    assert dodo.run(report=str(tmp_path / "other"))[0] == 0, "it is empty"
    (tmp_path / "other" / "mine.txt").touch()
    assert dodo.run(report=str(tmp_path / "other"))[0] == 0, "it holds a report"
    (tmp_path / "index").mkdir()
    for name, text in (("index.html", "mine"), (".gitignore", "*.pyc\n"), ("results.json", "[]")):
        (tmp_path / "index" / name).write_text(text)
        code, out, err = dodo.run(report=str(tmp_path / "index"))
        assert code == 2 and "holds other files and no report; name a new or empty folder with --report" in out + err
    assert (tmp_path / "index" / "index.html").read_text() == "mine"


def test_report_among_tests_is_refused_and_harms_nothing(dodo: Command) -> None:
    code, out, err = dodo.run(report="generated")
    assert code == 2
    assert "holds other files and no report" in out + err
    assert Path("generated/test/test.json").is_file()


def test_tampered_compiled_tests_are_refused(dodo: Command) -> None:
    folder = dodo.compiled(plan())
    raw = json.loads((folder / "test.json").read_text())
    (folder / "test.json").write_text(json.dumps({**raw, "slug": "../../x"}))
    code, _, err = dodo.dodo("run", "--compiled", str(folder))
    assert (code, "not a compiled test" in err) == (2, True)


USAGE = [
    (("--compiled", "nowhere"), "there is no compiled test at 'nowhere': No such file or directory"),
    (("no-such-test",), "unknown test 'no-such-test'"),
    (("--application", "none.yml"), "there is no file 'none.yml', expected the application's compose file"),
    (("a/b.dodo.yml",), "there is no test at"),
    (("--seed", "-1"), "'-1' is "),
    (("-j", "0"), "'0' is "),
    (("-q", "-v"), "not allowed with argument"),
]


@pytest.mark.parametrize(("words", "sentence"), USAGE, ids=[" ".join(words) for words, _ in USAGE])
def test_usage_errors_are_sentences(
    dodo: Command, words: tuple[str, ...], sentence: str, capsys: pytest.CaptureFixture[str]
) -> None:
    code, _, err = dodo.dodo("run", *words)
    assert (code, sentence in err + capsys.readouterr().err) == (2, True)


def test_a_real_rig_is_never_kept_up(dodo: Command) -> None:
    code, _, err = dodo.run("--keep", tested=replace(plan(), rig="kiwi", level="hil", isolation="host"))
    assert (code, "test runs on rig 'kiwi', which --keep would leave in motion" in err) == (2, True)


@pytest.mark.thorough
def test_quiet_says_only_the_counts_of_a_run_that_passed(dodo: Command) -> None:
    assert dodo.run("-q")[1] == "1 passed, 0 failed, 0 in error\n"
    dodo.stages = ENDINGS["failed"]
    assert [line.split()[0] for line in dodo.run("--quiet")[1].splitlines()] == ["FAILED", "in", "open", "0"]


def test_verbose_shows_lines_on_a_terminal_too(dodo: Command) -> None:
    stdout = Terminal()
    folder = dodo.compiled(plan())
    assert main(["run", "--compiled", str(folder), "--report", "report", "-v"], stdout, StringIO()) == 0
    assert "s] test  running\n" in stdout.getvalue()


def interrupted(dodo: Command, count: int) -> tuple[int, str]:
    """``dodo run`` of one test, several times one after the other, interrupted in the first."""

    class Interrupts(ScriptedBackend):
        async def begin(self) -> None:
            await super().begin()
            os.kill(os.getpid(), signal.SIGINT)

    dodo.stages = stages()
    dodo.backend = Interrupts
    code, out, _ = dodo.run("-j", "1", "--repeat", str(count))
    return code, out


def test_an_interrupt_leaves_the_other_tests_not_run(dodo: Command) -> None:
    code, out = interrupted(dodo, 3)
    assert code == 130
    assert "0 passed, 0 failed, 1 in error\n2 tests not run, because the run was interrupted: test[run=2], " in out
    document = json.loads(Path("report/results.json").read_text())
    assert [test["outcome"] for test in document["tests"]] == ["error"]
    assert [test["slug"] for test in document["not_run"]] == ["test--run-2", "test--run-3"]


class EndsOtherwise(ScriptedBackend):
    """The second of several runs ends later than the others."""

    def __init__(self, tested: Plan, events: Mapping[str, Events]) -> None:
        seconds = 5.0 if tested.slug.endswith("--run-2") else 4.0
        passed = stages(Time(seconds, last=True), PASSED, Exited("track", 0))
        super().__init__(tested, passed)


@pytest.mark.parametrize(("lockstep", "count", "code"), [(60.0, 3, 1), (60.0, 1, 0), (0.0, 3, 0)])
def test_repetitions_in_lockstep_that_differ_end_with_a_code(
    dodo: Command, lockstep: float, count: int, code: int
) -> None:
    dodo.backend = EndsOtherwise
    got, out, _ = dodo.run("--repeat", str(count), tested=plan(lockstep=lockstep))
    differs = "test: the runs in lockstep differ\n        test time: 4.0 s, 5.0 s, 4.0 s\n"
    assert (got, differs in out) == (code, bool(code))


def test_repetitions_in_lockstep_that_are_the_same_pass(dodo: Command) -> None:
    dodo.stages = stages(Time(4.0, last=True), PASSED, Exited("track", 0))
    code, out, _ = dodo.run("--repeat", "2", tested=plan(lockstep=60.0))
    assert (code, "test: the runs in lockstep have the same values\n" in out) == (0, True)
    code, out, _ = dodo.run("--repeat", "2", "-q", tested=plan(lockstep=60.0))
    assert (code, "same values" in out) == (0, False)


def test_an_interrupt_waits_for_no_page_of_a_test_before(dodo: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    drawn: list[str] = []
    drawn_when_interrupted: list[str] = []
    write = page.write

    def written(folder: Path, *rest: Any) -> None:
        write(folder, *rest)
        drawn.append(folder.name)

    class InterruptsLast(ScriptedBackend):
        async def begin(self) -> None:
            await super().begin()
            if self.plan.slug == "test--run-3":
                async with asyncio.timeout(100):
                    while len(drawn) < 2:
                        await asyncio.sleep(0.01)
                drawn_when_interrupted.extend(drawn)
                os.kill(os.getpid(), signal.SIGINT)

    monkeypatch.setattr(page, "write", written)
    dodo.backend = InterruptsLast
    code, _, _ = dodo.run("-j", "1", "--repeat", "4")
    assert code == 130
    assert drawn_when_interrupted == ["test", "test--run-2"]
    assert drawn == ["test", "test--run-2", "test--run-3"]
    index = Path("report/index.html").read_text()
    assert all(f'href="{slug}/drive.html"' in index for slug in drawn)


def test_an_interrupt_before_any_test_leaves_the_report_before(dodo: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    dodo.run()

    async def nothing(runner: Runner, jobs: Sequence[Job], _: object) -> list[Outcome]:
        runner.interrupted = True
        runner.not_run = [NotRun("test", "test", "test.dodo.yml", "sil", "the run was interrupted")]
        return []

    monkeypatch.setattr(Runner, "run", nothing)
    code, out, _ = dodo.run()
    assert (code, out.splitlines()[-1][:54]) == (130, "report: no test of this run began, so report/index.htm")
    assert dodo.result()["outcome"] == "passed"


def test_signals_do_after_a_run_what_they_did_before(dodo: Command) -> None:
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    interrupted(dodo, 1)
    assert signal.getsignal(signal.SIGTERM) == signal.SIG_IGN


def test_a_report_says_when_where_and_of_what_it_is(dodo: Command) -> None:
    dodo.run("--seed", "3")
    (run,) = json.loads(Path("report/results.json").read_text())["runs"]
    assert (run["host"], run["dodo"]) == (platform.node(), __version__)
    assert run["command"] == f"dodo run --seed 3 --compiled {dodo.folder / 'generated/test'}"
    assert abs((datetime.now(UTC) - datetime.fromisoformat(run["date"])).total_seconds()) < 60


STEPPED = ("--clock", "lockstep")


@pytest.mark.thorough
def test_hardware_keeps_its_clock_and_it_is_said(dodo: Command) -> None:
    (dodo.folder / "dodo.yml").write_text('dodo: 1\nregistry: ["dodo:"]\n')
    code, out, err = dodo.dodo("run", "hil-dynamic", *STEPPED)
    assert (code, out) == (2, "note: hil-dynamic in real time, because hardware does not wait\n")
    assert dodo.dodo("run", "hil-dynamic")[1] == ""
    assert err.startswith("dodo run: no application; ")


@pytest.mark.thorough
def test_who_cannot_be_a_process_is_told_what_to_write(dodo: Command) -> None:
    assert dodo.dodo("new", "--deployment")[0] == dodo.dodo("new", "mine")[0] == 0
    code, _, err = dodo.dodo("run", "mine", "--backend", "process")
    assert (code, "add for example 'x-dodo-process: [python, main.py]'" in err) == (2, True)


IMAGE = Application(".", (ApplicationService("app"),))
OWN = (PlannedService("environment", "camera", "camera", "dodo/camera:1", ("python",)),)


class Engine:
    """An engine's client that has one image, or none."""

    def __init__(self, *images: str, url: str = "http+docker://localhost", problem: Exception | None = None) -> None:
        self.images, self.api, self.base_url, self.problem = images, self, url, problem

    def inspect_image(self, image: str) -> None:
        if self.problem:
            raise self.problem
        if image not in self.images:
            raise ImageNotFound(image)


@pytest.mark.parametrize(
    ("engine", "root", "backend"),
    [
        (Engine("dodo/camera:1"), True, "docker"),
        (Engine(), True, "mixed"),
        (Engine(), False, "docker"),
        (Engine(url="https://elsewhere:2376"), True, "docker"),
        (Engine(problem=DockerException("gone")), True, "docker"),
        (None, True, "docker"),
    ],
)
def test_without_images_of_dodo(
    engine: Engine | None, root: bool, backend: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def connect() -> Any:
        if engine is None:
            raise BackendError("no engine")
        return engine

    monkeypatch.setattr("dodo_dsl.run.docker.client.connect", connect)
    monkeypatch.setattr(run, "may_enter", lambda: root)
    assert run.choose_backend([plan(application=IMAGE, services=OWN)]) == backend


def test_on_rigs_unless_the_application_can_be_started() -> None:
    assert run.choose_backend([plan(application=IMAGE, rig="desk")]) == "mixed"
    started = Application(".", (ApplicationService("app", ("python", "a.py")),))
    assert run.choose_backend([replace(plan(application=started), rig="desk")]) == "process"


def test_a_run_of_one_test_keeps_the_others_in_the_report(dodo: Command) -> None:
    """But for earlier runs of the same test, however often it ran."""
    for name, words in (("b", ()), ("a", ("--repeat", "2")), ("a", ())):
        out = dodo.run(*words, tested=plan(name))[1]
    assert out.endswith("index.html, with 1 test of earlier runs\n")
    document = json.loads(Path("report/results.json").read_text())
    assert [test["slug"] for test in document["tests"]] == ["a", "b"] and len(document["runs"]) == 3
    assert Path("report/b/drive.html").is_file() and not Path("report/a--run-2").exists()
