"""Attacks by compose files are refused, or what a test gets of them is harmless."""

import asyncio
import json
import pwd
import tempfile
from pathlib import Path
from typing import Any

import pytest
import yaml
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from dodo_dsl.plan.model import LAYERS
from dodo_dsl.run.docker.compose import Compose
from tests.application.compiled import FILE, Compiled, compiled, filled, repository
from tests.emit.readers import compose
from tests.hostile.harmless import KEYS, harm, is_harmless

TABLE: dict[str, dict[str, dict[str, Any]]] = yaml.safe_load((Path(__file__).parent / "compose_files.yml").read_text())
SECRET = "s3cr3t"


def attacks(*groups: str) -> list[Any]:
    """All, of which one in four is quick."""
    found = [(f"{name}, {group}", attack) for group in groups for name, attack in TABLE[group].items()]
    return [
        pytest.param(attack, id=name, marks=[pytest.mark.thorough] if number % 4 else [])
        for number, (name, attack) in enumerate(found)
    ]


def attacked(attack: dict[str, Any], folder: Path, **deployment: Any) -> tuple[Compiled, Path]:
    """The test of a repository with an attack, and the repository."""
    root = repository(folder, {".env": attack.get("env", ""), **attack.get("files", {})})
    for name, target in attack.get("links", {}).items():
        (root / name).symlink_to(target)
    service = {"image": "team/driver", "command": "--cid=111", **attack.get("service", {})}
    text = json.dumps({"services": {"driver": service}, **attack.get("file", {})}).replace("{repo}", str(root))
    return compiled(root, text, **deployment), root


GROUPS = ("refused", "left out", "secrets", "removed", "cut", "at run time", "odd")


@pytest.mark.parametrize("attack", attacks(*GROUPS))
def test_it_is_refused_or_harmless(attack: dict[str, Any], tmp_path: Path) -> None:
    """A file that asks for the host, other tests or secrets is refused, or its test has nothing of it."""
    test, root = attacked(attack, tmp_path, environment=list(attack.get("set", {})))
    if test.errors:
        assert {(told.file, bool(told.line and told.column)) for told in test.errors} == {(FILE, True)}
        return
    assert list(harm(test.document, root)) == []
    assert [word for word in (SECRET, *attack.get("gone", ())) if word in "".join(test.files.values())] == []


WORDS = st.sampled_from(
    ["", "host", "b", "1", "64g", "-1", "/", "..", "~", "/dev/sda:/d", "vol:/v", "${A:-/}", "$$A", "A=1"]
)
ANY = st.recursive(
    st.none() | st.booleans() | st.integers(-2, 1 << 40) | st.floats(allow_nan=False, allow_infinity=False) | WORDS,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(WORDS, inner, max_size=3),
    max_leaves=6,
)
ROWS = [attack for group in GROUPS for attack in TABLE[group].values()]


@pytest.mark.slow
@settings(suppress_health_check=[*HealthCheck], deadline=None, max_examples=100)
@given(
    st.lists(st.sampled_from(ROWS), max_size=4), st.dictionaries(st.sampled_from(sorted(KEYS | {"x"})), ANY, max_size=2)
)
def test_whatever_it_says(rows: list[dict[str, Any]], odd: dict[str, Any]) -> None:
    """Several attacks together, and keys with any values."""
    together: dict[str, Any] = {"service": {}, "file": {}, "files": {}, "links": {}}
    for row in rows:
        for part, joined in together.items():
            for key, value in row.get(part, {}).items():
                before = joined.get(key)
                joined[key] = [*before, *value] if isinstance(value, list) and isinstance(before, list) else value
    together["service"] |= odd
    with tempfile.TemporaryDirectory() as folder:
        test, root = attacked(together, Path(folder))
        if not test.errors:
            assert list(harm(test.document, root)) == []
            yaml.safe_load(test.files["application.compose.yml"])


@pytest.mark.parametrize("home", ["/", ""])
@pytest.mark.parametrize("mount", ["/etc:/h", "/etc:/h:ro", "~/.ssh:/h:ro", "~:/h", "/tmp/x:/h", "/opt:/h"])
def test_what_is_no_home(mount: str, home: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing of the host is an application's as its user has no home, or all of the host for one."""
    monkeypatch.delenv("HOME")
    if home:
        monkeypatch.setenv("HOME", home)
    monkeypatch.setattr(pwd, "getpwuid", nobody)
    test, _ = attacked({"service": {"volumes": [mount]}}, tmp_path)
    assert test.errors


def nobody(user: int) -> Any:
    raise KeyError(user)


def test_without_the_attack_all_is_well(tmp_path: Path) -> None:
    """Control: the same file without an attack is accepted."""
    test, root = attacked({}, tmp_path)
    assert test.told == ()
    assert is_harmless(test.document, root)


def test_what_an_attack_asks_for_is_harm(tmp_path: Path) -> None:
    """Control: the property sees what attacks would have if their words were taken as they are."""
    test, root = attacked({}, tmp_path)
    unseen = []
    for group in ("refused", "left out", "removed", "cut"):
        for name, attack in TABLE[group].items():
            service = {**test.document["services"]["driver"], **attack.get("service", {})}
            document = {**test.document, "services": {"driver": service}, **attack.get("file", {})}
            if "links" not in attack and "env" not in attack and is_harmless(filled(document, {}), root):
                unseen.append(name)
    assert unseen == []


@pytest.mark.parametrize(
    ("outer", "inner", "refused"),
    [
        ("{}/data:/d", "{}/data/x:/x:ro", True),
        ("{}/data:/d", "{}/link:/x", True),
        ("{}/data:/d:ro", "{}/data/x:/x", False),
        ("{}/data:/d", "{}/data:/x", False),
        ("{}/data:/d", "{}/data/out:/x", True),
        ("{}/data:/d", {"secrets": "{}/data/x/key"}, True),
        ("{}/data:/d", {"configs": "{}/data/x/key"}, True),
        ("{}/data:/d:ro", {"configs": "{}/data/x/key"}, False),
    ],
)
def test_folders_in_a_folder_that_is_allowed(
    outer: str, inner: str | dict[str, str], refused: bool, tmp_path: Path
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
        else:
            ((key, path),) = mount.items()
            own[key] = ["c"]
            document[key] = {"c": {"file": path.format(host)}}
        document["services"][f"s{number}"] = own
    test, _ = attacked({"file": document}, tmp_path, paths=[str(host)])
    assert [told.rule for told in test.errors] == ["application-isolation"] * refused


SECRETS = {
    **dict.fromkeys(("DATABASE_URL", "DODO_SEARCH_STORAGE"), "postgresql://dodo:s3cr3t@server/dodo"),
    **dict.fromkeys(("PGPASS", "GITLAB_PAT", "CI_JOB_TOKEN", "INNOCENT"), SECRET),
}


def given(test: Compiled, folder: Path) -> dict[str, Any]:
    """The application's services as the engine gets them, variables filled in; and what is built of them."""
    assert test.plan is not None
    made = Compose(test.plan, test.write(), folder / "report", "dodo-t", print)
    made.read()
    document, file = made.document(), folder / "given.json"
    own = test.plan.application.compose["services"]
    document["services"] |= {name: {**service, **document["services"][name]} for name, service in own.items()}
    file.write_text(json.dumps(document))
    files, out = [*(f"{layer}.compose.yml" for layer in LAYERS if layer != "application"), str(file)], folder / "out"
    code, problem = asyncio.run(made.run("config", "--format", "json", "--output", str(out), files=files))
    assert code == 0, problem
    return {name: json.loads(out.read_text())["services"][name] for name in own}


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
    test, _ = attacked({"service": service}, tmp_path, environment=list(passed))
    assert test.errors == [] and test.plan is not None
    named = {told.text.split("'")[1] for told in test.told if told.rule == "application-secret"}
    assert named == {*SECRETS} - {*passed}
    text = json.dumps(given(test, tmp_path))
    assert (SECRET in text) == bool(passed)
    assert "postgresql" not in text


@pytest.mark.slow
def test_without_the_attack_the_engine_gets_all(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Control: the engine gets the secrets of the application's own file, and no file of the test has them."""
    compose()
    monkeypatch.setenv("CI_JOB_TOKEN", "pipeline")
    monkeypatch.setenv("API_KEY", "pipeline")
    variables = {"A": "${API_KEY}", "B": "${CI_JOB_TOKEN:-none}"}
    test, _ = attacked({"service": {"environment": variables}, "env": f"API_KEY={SECRET}"}, tmp_path)
    assert test.plan is not None
    assert given(test, tmp_path)["driver"]["environment"] == {"A": SECRET, "B": "none"}
