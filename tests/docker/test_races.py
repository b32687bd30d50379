"""Services of an application swap what others mount, in five ways at once and without end, while these start.

A try is one mount of a container that starts under attack, and could have shown a file of the host. What they write
goes with the test, and no variable of the host comes to them.
"""

import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pytest

from dodo_dsl import __version__
from tests.ordinary_user import words_as_user
from tests.run.desk import ROOT

pytestmark = [pytest.mark.engine, pytest.mark.usefixtures("images")]

TEST = "sil-closed-straight"
TRIES = int(os.environ.get("DODO_RACE_TRIES", "500"))
"""Of the proof, in all."""
LOOKERS = 10
EXCHANGE = """
import ctypes, os
os.symlink("{host}", "/app/link")
swap = ctypes.CDLL(None).renameat2
print("swaps", flush=True)
while True:
    assert swap(-100, b"/app/link", -100, b"/app/exchanged", 2) == 0
"""
LOOP = (
    "cd /app && echo swaps && while mv {name} {name}.gone && ln -s {link} {name} && rm {name} && mv {name}.gone {name};"
    " do true; done"
)
ATTACKS: dict[str, tuple[list[str], list[str]]] = {
    "folder": ([".:/app"], ["sh", "-c", LOOP.format(name="moved", link="{host}")]),
    "file": ([".:/app"], ["sh", "-c", LOOP.format(name="lone", link="{host}/own")]),
    "parent": ([".:/app"], ["sh", "-c", LOOP.format(name="outer", link="{host}")]),
    "exchange": ([".:/app"], ["python3", "-c", EXCHANGE]),
    "copy": (["./outer:/app"], ["sh", "-c", LOOP.format(name="deep", link="{host}/deep")]),
}
"""Each with its mounts, and what it runs in them."""
MOUNTS = [
    "./moved:/see/0", "./moved:/see/1:ro", "./lone:/see/2/own", "./exchanged:/see/3", "./exchanged/:/see/4:ro",
    "./outer/deep:/see/5", "./outer/deep/sub:/see/6:ro", "./outer/deep/own:/see/7/own", "./fresh:/see/8:ro",
    "./outer:/see/9:ro",
]  # fmt: skip
LOOK = (
    "env; touch /see/*/written /see/2/own /see/7/own 2> /dev/null;"
    ' for number in 0 1 2 3 4 5 6 7 8; do echo "sees $(cat /see/$number/own)"; done;'
    ' echo "sees $(cat /see/9/deep/own || echo own)"; if cat {host}/own; then echo sees HOST; fi'
)
SEEN = 10
"""What each looker looks at."""


def service(words: Sequence[str], volumes: Sequence[str], host: Path, **keys: Any) -> dict[str, Any]:
    image = f"dodo/base:{__version__}"
    words = [word.replace("{host}", str(host)).replace("$", "$$") for word in words]
    shown = {"image": image, "user": "0:0", "entrypoint": words, "command": "--cid=111", "network_mode": "none"}
    return {**shown, "volumes": list(volumes), "environment": ["DATABASE_URL"], **keys}


def after(names: Sequence[str], condition: str) -> dict[str, Any]:
    return {name: {"condition": condition} for name in names}


def repository(folder: Path, attacks: Mapping[str, tuple[list[str], list[str]]], mounts: Sequence[str]) -> Path:
    """A repository with an application that attacks itself, beside a folder of the host that it wants to see."""
    host, team = folder / "host", folder / "team"
    for place in (host, host / "deep", host / "deep" / "sub"):
        place.mkdir()
        (place / "own").write_text("HOST")
    for name in (TEST, "maps"):
        shutil.copytree(ROOT / "tests_registry" / name, team / "tests" / name)
    for name in ("moved", "exchanged", "fresh", "outer/deep/sub"):
        (team / name).mkdir(parents=True)
        (team / name / "own").write_text("own")
    for name in ("lone", "outer/deep/own"):
        (team / name).write_text("own")
    services = {name: service(words, volumes, host) for name, (volumes, words) in attacks.items()}
    begun = after([*services], "service_started")
    lookers = {f"looks-{n}": service(["sh", "-c", LOOK], mounts, host, depends_on=begun) for n in range(LOOKERS)}
    done = service(["false"], [], host, depends_on=after([*lookers], "service_completed_successfully"))
    document = {"services": {**services, **lookers, "done": done}}
    (team / "docker-compose.yml").write_text(json.dumps(document))
    (team / "dodo.yml").write_text("dodo: 1\nregistry: [tests]\napplication: docker-compose.yml\n")
    return team


def looks(team: Path, backend: str, before: Sequence[str]) -> list[str]:
    """What the services of one test saw."""
    own = {"PYTHONPATH": str(ROOT), "DODO_LEASES": str(team / "leases"), "DATABASE_URL": "x://a:s3cr3t@b"}
    words = ["run", TEST, "--backend", backend, "--clock", "realtime", "-q", "--report", str(team / "report")]
    if backend == "mixed" and before:
        words += ["--isolation", "host"]
    command = [*before, sys.executable, "-m", "dodo_dsl", *words]
    subprocess.run(command, cwd=team, env={**os.environ, **own}, check=False)
    (test,) = json.loads((team / "report" / "results.json").read_text())["tests"]
    assert test["reason"].startswith("application service 'done' ended with exit code 1"), test["reason"]
    logs = team / "report" / TEST / "logs"
    for name in ATTACKS:
        assert (logs / f"application.{name}.log").read_text().startswith("swaps"), name
    said = "".join((logs / f"application.looks-{n}.log").read_text() for n in range(LOOKERS))
    assert "HOSTNAME=" in said and "s3cr3t" not in said
    return [line.removeprefix("sees ") for line in said.splitlines() if line.startswith("sees ")]


def contents(team: Path) -> dict[str, str]:
    """The files and folders of a repository, without what DoDo writes."""
    own = (path for path in team.rglob("*") if path.relative_to(team).parts[0] not in ("report", "leases"))
    return {str(path): path.read_text(errors="replace") if path.is_file() else "" for path in own}


def configured(folder: Path) -> Path:
    """A folder with root's plug-ins of the docker command, as those of a user."""
    plugins = folder / "docker" / "cli-plugins"
    plugins.mkdir(parents=True, exist_ok=True)
    for path in Path("~/.docker/cli-plugins").expanduser().glob("*"):
        shutil.copy(path, plugins / path.name)
    return plugins.parent


def attacked(folder: Path, backend: str, user: str, tries: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """``folder`` is one that an ordinary user reaches."""
    count = 0
    while count < tries:
        run = folder / f"{backend}-{user}-{count}"
        run.mkdir()
        team = repository(run, ATTACKS, MOUNTS)
        as_it_was = contents(team)
        before: list[str] = []
        if user == "user":
            for path in (folder, run, *run.rglob("*")):
                os.lchown(path, 12_345, 12_345)
            monkeypatch.setenv("DOCKER_CONFIG", str(configured(folder)))
            before = words_as_user(run, groups=(Path("/var/run/docker.sock").stat().st_gid,))
        seen = looks(team, backend, before)
        assert len(seen) >= 0.9 * LOOKERS * SEEN and set(seen) == {"own"}, seen
        assert contents(team) == as_it_was
        count += len(seen)
        print(f"{backend} as {user}: {count} tries, 0 saw the host")


WAYS = [("docker", "root"), ("mixed", "root"), ("docker", "user"), ("mixed", "user")]


@pytest.mark.skipif(os.geteuid() != 0, reason="only root becomes another user")
@pytest.mark.parametrize(
    ("backend", "user", "tries"),
    [("docker", "root", 1), *(pytest.param(*way, TRIES // len(WAYS), marks=pytest.mark.proof) for way in WAYS)],
)
def test_no_race_is_won(backend: str, user: str, tries: int, monkeypatch: pytest.MonkeyPatch) -> None:
    with tempfile.TemporaryDirectory(prefix="dodo-race-") as name:
        attacked(Path(name), backend, user, tries, monkeypatch)
