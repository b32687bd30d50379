"""What reading a compose file is made of, each beside what compose itself makes of the same words."""

import json
import string
import subprocess
from pathlib import Path
from typing import Any

import pytest
import yaml
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from dodo_dsl import source
from dodo_dsl.application import interpolation, opendlv_flags
from dodo_dsl.application.compose_paths import rebased
from dodo_dsl.application.model import plain
from dodo_dsl.application.read import read_application
from dodo_dsl.emit.render import render_plan
from dodo_dsl.plan.model import Plan
from dodo_dsl.plan.rewrite.rewrite import plan_application
from dodo_dsl.run.process.environment import dotenv, interpolate
from tests.compiler.test_output import compose

GOOD = Path(__file__).parent / "applications" / "good"


def config(folder: Path, *words: str) -> Any:
    """What compose makes of files."""
    command = [*compose(), *words, "config", "--format", "json"]
    result = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stderr
    return json.loads(result.stdout)["services"]


COMMANDS = [
    "--cid=111 --name=video0.argb",
    r"""prog a\tb "c\td\e" 'x\y' --x="1 2"y "" end""",
    "one --two=${A:-${B:-x}} $A ${C:-c d}e $$A '$$A'",
    r"nice -n -5 /usr/bin/camera --camera=http://host/video.cgi\\?channel=0 --cid=100",
    'sh -c "prog --cid=111 && other; last" more',
    "prog > file",
    "  spaces   around\tand tabs  ",
    "first\nsecond",
]


@pytest.mark.parametrize("command", COMMANDS)
def test_commands_are_split_as_compose_splits_them(command: str, tmp_path: Path) -> None:
    (tmp_path / "c.yml").write_text(yaml.safe_dump({"services": {"a": {"image": "x", "command": command}}}))
    (tmp_path / ".env").write_text("A=a\nC=c\n")
    expected = [word.replace("$$", "$") for word in config(tmp_path, "-f", "c.yml")["a"]["command"]]
    assert [interpolate(word, {"A": "a", "C": "c"}) for word in opendlv_flags.split(command)] == expected


DOTENV = r"""
# a comment
PLAIN=word
export EXPORTED=two words   # and a comment
HASH=a#b
DOUBLE="x\\y \"q\" l\nm $$A \$A"
SINGLE='a\nb $PLAIN it\'s'
REFERS=${PLAIN}-${ABSENT:-none}
MULTI="first
second" # after
EMPTY=
BACK=x\\y
YAML: value
SPACED = 3
"""


def test_dotenv_files_are_read_as_compose_reads_them(tmp_path: Path) -> None:
    found = interpolation.dotenv(DOTENV)
    service = {"image": "x", "environment": [f"{name}=${{{name}}}" for name in found]}
    (tmp_path / "c.yml").write_text(yaml.safe_dump({"services": {"a": service}}))
    (tmp_path / ".env").write_text(DOTENV)
    expected = config(tmp_path, "-f", "c.yml")["a"]["environment"]
    assert dotenv(tmp_path / ".env", {}) == {name: value.replace("$$", "$") for name, value in expected.items()}
    (tmp_path / ".env").write_text("".join(interpolation.dotenv_line(*pair) + "\n" for pair in found.items()))
    assert config(tmp_path, "-f", "c.yml")["a"]["environment"] == expected


@given(st.dictionaries(st.text(string.ascii_letters, min_size=1), st.text(st.characters(exclude_characters="\0\r"))))
def test_dotenv_lines_are_read_back(values: dict[str, str]) -> None:
    doubled = {name: value.replace("$", "$$") for name, value in values.items()}
    assert interpolation.dotenv("\n".join(interpolation.dotenv_line(*pair) for pair in doubled.items())) == doubled


@pytest.mark.parametrize("style", ["several", "extends", "include", "anchors"])
def test_files_are_merged_as_compose_merges_them(style: str, tmp_path: Path) -> None:
    """Everything that DoDo does not change is for compose the same in the merged file as in the many."""
    files = sorted(p for p in (GOOD / style).iterdir() if p.suffix == ".yml")[::-1]
    found, problems = read_application(files)
    assert found is not None, problems
    services = {name: plain(service.node) for name, service in found.services.items()}
    document = {"services": services, **{key: plain(node) for key, node in found.rest.items()}}
    (GOOD / style / ".merged").write_text(yaml.safe_dump(document))
    try:
        many = config(GOOD / style, *(word for file in files for word in ("-f", file.name)))
        one = config(GOOD / style, "-f", ".merged")
    finally:
        (GOOD / style / ".merged").unlink()
    for service in (*many.values(), *one.values()):
        service.pop("networks", None)
        if style == "include":  # a tag from the included folder's .env, which is not the merged file's
            service.pop("image", None)
    assert one == many


@pytest.mark.parametrize(
    ("path", "expected"),
    [
        ("./a", "../team/a"),
        ("a/../b", "../team/b"),
        (".", "../team"),
        ("../x", "../x"),
        ("/abs", "/abs"),
        ("~/home", "~/home"),
        ("${PWD}/map", "../team/map"),
        ("$PWD", "../team"),
        ("$PWDS/map", "$PWDS/map"),
        ("${HOME}/x", "${HOME}/x"),
        ("${A:-./b}/c", "${A:-../team/b}/c"),
        ("./x/${A:-a/../b}", "../team/x/${A:-a/../b}"),
        ("https://example.org/x.git#v1:sub", "https://example.org/x.git#v1:sub"),
        ("git@example.org:x.git", "git@example.org:x.git"),
        ("docker-image://alpine", "docker-image://alpine"),
    ],
)
def test_paths_from_another_folder(path: str, expected: str) -> None:
    assert rebased(path, "../team") == expected


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("--cid=${CID:-${X:-3}} -v", "--cid=140 -v"),
        ('sh -c "p --cid=111;x --cid 5 && q --cid --verbose"', 'sh -c "p --cid=140;x --cid 140 && q --cid --verbose"'),
        ('--cid="111" a', "--cid=140 a"),
        (r"\"--cid=111\" --cid=\"111\"", r"\"--cid=140\" --cid=140"),
        ("--cid=$$(cat /cid) x", "--cid=140 x"),
        ("--cid-file=3 x--cid=4 --cidr=2", "--cid-file=3 x--cid=4 --cidr=2"),
        ("--cid= --verbose", "--cid=140 --verbose"),
        ("(prog --cid=$CID)", "(prog --cid=140)"),
    ],
)
def test_cid_in_texts(text: str, expected: str) -> None:
    assert opendlv_flags.with_cid_text(text, 140) == expected


@pytest.mark.parametrize(
    ("text", "expected"),
    [("${A:-${B:-c}}", "c"), ("${A:-${S}}!", "set!"), ("${S:+${A:-x}y}", "xy"), ("$${S}$S}", "${S}set}"), ("${", "${")],
)
def test_variables_nest(text: str, expected: str) -> None:
    assert interpolate(text, {"S": "set"}) == expected


KEYS = {
    "command": st.text(max_size=20) | st.lists(st.text(max_size=8) | st.integers() | st.booleans(), max_size=3),
    "environment": st.dictionaries(st.text(max_size=5), st.none() | st.text(max_size=8) | st.floats(), max_size=3)
    | st.lists(st.sampled_from(["CID", "CID=1", "A=--cid=3", "="]), max_size=3),
    "volumes": st.lists(st.sampled_from(["/tmp:/tmp", "./a:/b:ro", "x", "${A:-b:c}:/d", ":", "tmp:/t", "/dev:/dev"])),
    "networks": st.sampled_from([["a"], {"a": None}, {"a": {"aliases": ["b"]}}, {}, None]),
    "network_mode": st.sampled_from(["host", "none", "service:b", "bridge", "", "container:c"]),
    "depends_on": st.sampled_from([["b"], {"b": {"condition": "service_started"}}, {}, None]),
    "build": st.sampled_from([".", "a", {"context": "x"}, {"dockerfile": "D"}, {}, None]),
    "env_file": st.sampled_from(["~/a", [{"path": "a", "required": False}], [], None]),
    "profiles": st.sampled_from([[], ["p"], None]),
    "deploy": st.sampled_from([{"replicas": 0}, {"mode": "global"}, {}, None]),
    "cap_add": st.lists(st.text(max_size=4), max_size=2),
    "security_opt": st.lists(st.sampled_from(["seccomp:unconfined", "seccomp=./p.json", "x"])),
    "sysctls": st.sampled_from([{"net.a": 1}, ["net.a=1", "b=2"], {}, None]),
    "container_name": st.sampled_from(["c", None]),
    "healthcheck": st.sampled_from([{"test": "x --cid=1"}, {"disable": True}, None]),
    "extends": st.sampled_from(["b", {"service": "b"}]),
    "x-dodo": st.sampled_from([{}, {"in": ["a.B/1"], "done": "a.C", "readers": 2}]),
    "labels": st.dictionaries(st.text(max_size=4), st.text(max_size=4), max_size=2),
    "anything": st.recursive(
        st.none() | st.text() | st.integers(), lambda x: st.lists(x) | st.dictionaries(st.text(), x)
    ),
}
IMAGE = {"image": st.text(min_size=1, max_size=8)}
SERVICE = st.fixed_dictionaries(IMAGE, optional=KEYS)
SERVICES = st.fixed_dictionaries({"b": SERVICE}, optional={"a": SERVICE})


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None, max_examples=60)
@given(services=SERVICES, isolation=st.sampled_from(["network", "host"]), hil=st.booleans())
@example(
    services={"b": {"environment": {"X": "1e3", "Y": "0o17", "Z": "08", "N": "null", "D": "2020-01-01"}}},
    isolation="network",
    hil=False,
)
@example(services={"b": {"image": "\x85"}}, isolation="network", hil=False)
@example(services={"b": {"image": "a\u2028b", "command": "x \x85\u2029 y"}}, isolation="network", hil=False)
def test_what_is_read_can_be_rewritten(services: dict[str, Any], isolation: str, hil: bool, tmp_path: Path) -> None:
    """Whatever mapping the reader takes, its copy is YAML that says what the Plan says."""
    file = tmp_path / "docker-compose.yml"
    file.write_text(json.dumps({"services": services}))
    found, problems = read_application(file)
    if found is None:
        assert any(p.severity == "error" for p in problems)
        return
    application = plan_application(found, 140, isolation, tmp_path / "generated" / "t", ("track",), hil=hil)
    common = ("", "sil", "closed-loop", 10.0, "realtime", isolation, 1, 140, "", "sil", "sandbox", ())
    texts = {f.path: f.text for f in render_plan(Plan("t", "t", "t.dodo.yml", *common, application))}
    node, wrong = source.parse(texts["t/application.compose.yml"], "copy")
    assert node is not None and not wrong
    assert repr(source.plain(node)) == repr(application.compose)


HUGE = {
    "a text": {"a": {"image": "x", "command": "--cid={" * 100_000}},
    "many services": {f"s{n}": {"image": "x", "depends_on": [f"s{n + 1}"]} for n in range(3_000)},
    "a chain": {f"s{n}": {"image": "x", "extends": f"s{n + 1}", "environment": [f"A{n}=1"]} for n in range(2_000)},
    "many copies": {
        "s": {"image": "x", "environment": [f"A{n}=1" for n in range(5_000)]},
        **{f"s{n}": {"image": "x", "extends": "s"} for n in range(2_000)},
    },
}


@pytest.mark.parametrize("services", HUGE.values(), ids=HUGE)
def test_what_would_grow_without_end_is_refused(services: dict[str, Any], tmp_path: Path) -> None:
    file = tmp_path / "docker-compose.yml"
    file.write_text(json.dumps({"services": services}))
    found, problems = read_application(file)
    assert found is None
    assert "too-large" in {p.rule for p in problems}


def test_links_are_not_followed(tmp_path: Path) -> None:
    (tmp_path / "secret").write_text("CID=1\nPASSWORD=hidden\nservices: {a: {image: secret}}\n")
    folder = tmp_path / "team"
    folder.mkdir()
    for name in (".env", "common.yml"):
        (folder / name).symlink_to(tmp_path / "secret")
    file = folder / "docker-compose.yml"
    file.write_text("services: {b: {image: x, command: --cid=1}}\n")
    found, problems = read_application(file)
    assert found is not None and problems == [] and found.variables == {}
    file.write_text("services: {b: {extends: {file: common.yml, service: a}}}\n")
    found, problems = read_application(file)
    assert found is None
    assert [p.message for p in problems] == ["'common.yml' is a symbolic link, expected a regular file"]
