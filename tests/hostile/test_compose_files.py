"""Attacks by compose files are refused, left out, or stopped at run time."""

import asyncio
import pwd
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import pytest
import yaml

from dodo_dsl.application.access.model import Access
from dodo_dsl.application.read import read_application
from dodo_dsl.diagnostics import Diagnostic, has_errors
from dodo_dsl.emit.render import render_plan
from dodo_dsl.plan.model import Application, Plan, PlannedService
from dodo_dsl.plan.rewrite.rewrite import plan_application
from dodo_dsl.plan.rewrite.service_copy import Setting
from dodo_dsl.run.docker.compose import Compose
from dodo_dsl.run.protocol import BackendError
from tests.emit.readers import compose

TABLE: dict[str, dict[str, dict[str, Any]]] = yaml.safe_load((Path(__file__).parent / "compose_files.yml").read_text())
SECRET = "s3cr3t"
JUDGE = PlannedService("evaluation", "judge-of-test", "collision", "dodo/collision:1", (), (), True)


def attacks(group: str, once_per: str = "") -> list[Any]:
    """Those of a group; ``once_per`` is a key of which each value is tried once, and more often by ``make proof``."""
    seen: set[str] = set()
    found = []
    for name, attack in TABLE[group].items():
        marks = [pytest.mark.proof] if once_per and attack[once_per] in seen else []
        seen.add(attack.get(once_per, ""))
        found.append(pytest.param(attack, id=name, marks=marks))
    return found


def written(attack: dict[str, Any], folder: Path) -> Path:
    """The attack as the compose file of a repository."""
    repository = folder / "team"
    repository.mkdir()
    (repository / "dodo.yml").write_text("dodo: 1\n")
    (repository / ".env").write_text(attack.get("env", ""))
    for name, target in attack.get("links", {}).items():
        (repository / name).symlink_to(target)
    for name, text in attack.get("files", {}).items():
        (repository / name).parent.mkdir(exist_ok=True)
        (repository / name).write_text(text)
    service = {"image": "team/driver", "command": "--cid=111", **attack.get("service", {})}
    file = repository / "docker-compose.yml"
    text = yaml.safe_dump({"services": {"driver": service}, **attack.get("file", {})})
    file.write_text(text.replace("{repo}", str(repository)))
    return file


def found(
    attack: dict[str, Any], folder: Path, passed: Iterable[str] = ()
) -> tuple[Application | None, list[Diagnostic]]:
    source, problems = read_application(written(attack, folder), Access(passed=tuple(passed)))
    if source is None:
        return None, problems
    return plan_application(source, Setting(140, "network", folder / "generated" / "t", (JUDGE.name,))), problems


def plan(application: Application) -> Plan:
    common = ("", "sil", "closed-loop", 10.0, "realtime", "network", 1, 140, "10.213.0.0/28", "sil", "dodo/sandbox:1")
    return Plan("t", "t", "t.dodo.yml", *common, (JUDGE,), application)


@pytest.mark.parametrize("attack", attacks("refused"))
def test_what_is_refused(attack: dict[str, Any], tmp_path: Path) -> None:
    """Compose files that reach the host, or other tests, are refused with file, line and column."""
    application, problems = found(attack, tmp_path)
    assert application is None
    errors = [problem for problem in problems if problem.severity == "error"]
    assert {problem.rule for problem in errors} <= {"application-isolation", "unknown-key"}
    for problem in errors:
        assert Path(problem.span.file).name == "docker-compose.yml"
        assert problem.span.line and problem.span.column
        assert "links" not in attack or "symbolic link" in problem.message
        assert problem.hint or problem.rule == "application-isolation"


@pytest.mark.parametrize("home", ["/", ""])
@pytest.mark.parametrize("mount", ["/etc:/h", "/etc:/h:ro", "~/.ssh:/h:ro", "~:/h", "/tmp/x:/h", "/opt:/h"])
def test_what_is_no_home(mount: str, home: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing of the host is an application's as its user has no home, or all of the host for one."""
    monkeypatch.delenv("HOME")
    if home:
        monkeypatch.setenv("HOME", home)
    monkeypatch.setattr(pwd, "getpwuid", nobody)
    application, problems = found({"service": {"volumes": [mount]}}, tmp_path)
    assert application is None
    assert [problem.rule for problem in problems] == ["application-isolation"]


def nobody(user: int) -> Any:
    raise KeyError(user)


@pytest.mark.parametrize("attack", attacks("left out"))
def test_what_is_left_out(attack: dict[str, Any], tmp_path: Path) -> None:
    """Hardware and privileges are left out of simulations, with a warning."""
    application, problems = found(attack, tmp_path)
    assert not has_errors(problems)
    assert {problem.severity for problem in problems} == {"warning"}
    gone(attack, application)


@pytest.mark.parametrize("attack", attacks("cut"))
def test_what_is_cut(attack: dict[str, Any], tmp_path: Path) -> None:
    """Limits beyond those of the test are cut to them, with a warning."""
    application, problems = found(attack, tmp_path)
    assert {(problem.severity, problem.rule) for problem in problems} == {("warning", "application-limit")}
    gone(attack, application)


@pytest.mark.parametrize("attack", attacks("removed"))
def test_what_is_removed(attack: dict[str, Any], tmp_path: Path) -> None:
    """What would set the host or other tests is removed from the test's copy."""
    application, problems = found(attack, tmp_path)
    assert problems == []
    gone(attack, application)


def gone(attack: dict[str, Any], application: Application | None) -> None:
    assert application is not None
    text = yaml.safe_dump(application.compose) + yaml.safe_dump(application.variables)
    assert [word for word in attack["gone"] if word in text] == []
    assert not [file.path for file in render_plan(plan(application)) if SECRET in file.text]


@pytest.mark.slow
@pytest.mark.parametrize("attack", attacks("at run time", once_per="says"))
def test_what_is_stopped_at_run_time(attack: dict[str, Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What only the engine would see is stopped before anything is created."""
    compose()
    monkeypatch.delenv("X", raising=False)
    application, problems = found(attack, tmp_path, attack["set"])
    assert application is not None, problems
    for file in render_plan(plan(application)):
        path = tmp_path / "generated" / file.path
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(file.text)
    folder, report = tmp_path / "generated" / "t", tmp_path / "report"
    for name, value in attack["set"].items():
        monkeypatch.setenv(name, value.replace("{repo}", str(tmp_path / "team")))
    with pytest.raises(BackendError, match="the application may not have ") as refused:
        asyncio.run(Compose(plan(application), folder, report, "dodo-t", print).read())
    assert str(refused.value).startswith(f"the application may not have {attack['says']}: "), refused.value


def test_without_the_attack_all_is_well(tmp_path: Path) -> None:
    """Control: the same file without an attack is accepted."""
    application, problems = found({}, tmp_path)
    assert application is not None
    assert problems == []


@pytest.mark.parametrize(
    ("outer", "inner", "refused"),
    [
        ("{}/data:/d", "{}/data/x:/x:ro", True),
        ("{}/data:/d", "{}/link:/x", True),
        ("{}/data:/d:ro", "{}/data/x:/x", False),
        ("{}/data:/d", "{}/data:/x", False),
        ("{}/data:/d", "{}/data/out:/x", True),
        ("{}/data:/d", {"volumes": "{}/data/x"}, True),
        ("{}/data:/d", {"volumes": "{}/data/x", "o": "${NOBODY}"}, True),
        ({"volumes": "{}/data"}, "{}/data/x:/x", True),
        ({"volumes": "{}/data"}, {"secrets": "{}/data/x/key"}, True),
        ({"volumes": "{}/data", "o": "bind,ro"}, {"secrets": "{}/data/x/key"}, False),
        ("{}/data:/d", {"configs": "{}/data/x/key"}, True),
        ("{}/data:/d:ro", {"configs": "{}/data/x/key"}, False),
        ("/dev/shm:/d", {"volumes": "/dev/shm/x"}, True),
    ],
)
def test_folders_in_a_folder_that_is_allowed(
    outer: str | dict[str, str], inner: str | dict[str, str], refused: bool, tmp_path: Path
) -> None:
    """No service leads another one's mount elsewhere in a folder to which dodo.yml lets it write."""
    host = tmp_path / "host"
    (host / "data" / "x").mkdir(parents=True)
    (host / "link").symlink_to("data/x")
    (host / "data" / "out").symlink_to("../other")
    document: dict[str, dict[str, Any]] = {"services": {}}
    for number, mount in enumerate((outer, inner)):
        own: dict[str, Any] = {"image": "x", "command": "--cid=111"}
        if isinstance(mount, str):
            own["volumes"] = [mount.format(host)]
        elif "volumes" in mount:
            own["volumes"] = [f"v{number}:/v"]
            options = {"type": "none", "o": mount.get("o", "bind"), "device": mount["volumes"].format(host)}
            document.setdefault("volumes", {})[f"v{number}"] = {"driver_opts": options}
        else:
            ((key, path),) = mount.items()
            own[key] = ["c"]
            document[key] = {"c": {"file": path.format(host)}}
        document["services"][f"s{number}"] = own
    file = written({"file": document}, tmp_path)
    source, problems = read_application(file, Access(paths=(str(tmp_path / "host"),)))
    assert (source is None) == refused
    assert ["could put a link in its place" in problem.message for problem in problems] == [True] * refused


SECRETS = {
    **dict.fromkeys(("DATABASE_URL", "DODO_SEARCH_STORAGE"), "postgresql://dodo:s3cr3t@server/dodo"),
    **dict.fromkeys(("PGPASS", "GITLAB_PAT", "CI_JOB_TOKEN", "INNOCENT"), SECRET),
}


@pytest.mark.slow
@pytest.mark.parametrize("passed", [(), ("INNOCENT",)])
def test_secrets_of_the_host_stay_there(
    passed: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of DoDo's environment the application gets what is passed, in whatever way its file names more."""
    compose()
    for name, value in SECRETS.items():
        monkeypatch.setenv(name, value)
    words = [f"${{{name}}}" for name in SECRETS]
    service = {
        "environment": [*SECRETS, *(f"{name}_2={word}" for name, word in zip(SECRETS, words, strict=True))],
        "command": ["--cid=111", *words],
        "labels": {"l": " ".join(words)},
        "healthcheck": {"test": ["CMD", "echo", *words]},
        "build": {"context": ".", "args": [*SECRETS], "dockerfile_inline": f"FROM scratch\n# {' '.join(words)}"},
    }
    application, problems = found({"service": service}, tmp_path, passed)
    assert application is not None
    named = {problem.message.split("'")[1] for problem in problems if problem.rule == "application-secret"}
    assert named == {*SECRETS} - {*passed}
    for file in render_plan(plan(application)):
        path = tmp_path / "generated" / file.path
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(file.text)
    test = Compose(plan(application), tmp_path / "generated" / "t", tmp_path / "report", "dodo-t", print)
    asyncio.run(test.read())
    text = yaml.safe_dump(test.services)
    assert (SECRET in text) == bool(passed)
    assert "postgresql" not in text


@pytest.mark.slow
def test_without_the_attack_the_engine_gets_all(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Control: the engine gets the same file without an attack."""
    compose()
    monkeypatch.setenv("CI_JOB_TOKEN", "pipeline")
    monkeypatch.setenv("API_KEY", "pipeline")
    variables = {"A": "${API_KEY}", "B": "${CI_JOB_TOKEN:-none}", "CI_JOB_TOKEN": None}
    application, _ = found({"service": {"environment": variables}, "env": f"API_KEY={SECRET}"}, tmp_path)
    assert application is not None
    for file in render_plan(plan(application)):
        path = tmp_path / "generated" / file.path
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(file.text)
    test = Compose(plan(application), tmp_path / "generated" / "t", tmp_path / "report", "dodo-t", print)
    asyncio.run(test.read())
    assert test.services["driver"]["environment"] == {"A": SECRET, "B": "none", "CI_JOB_TOKEN": None}
