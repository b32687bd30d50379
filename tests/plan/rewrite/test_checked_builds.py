"""The application's builds, as they are checked."""

from pathlib import Path
from typing import Any

import pytest
import yaml

from dodo_dsl.application.access.model import Access
from dodo_dsl.application.read import read_application
from dodo_dsl.plan.rewrite.checked_builds import checked_builds

WRITTEN = """
services:
  a:
    build:
      context: ./${WHERE:-app}
      dockerfile: Dockerfile.car
      args: [BASE, OTHER, "TAG=${TAG:-1}", COST=$$5]
      additional_contexts: {maps: ./maps, remote: "https://a.b/c.git"}
      secrets: [licence]
      ssh: [default]
      cache_to: ["type=local,dest=./c"]
      tags: [x]
      shm_size: 64g
      x-bake: {output: ["type=local,dest=/etc"]}
    command: --cid=111
  b: {build: ., command: --cid=111}
  c: {image: c, command: --cid=111}
secrets:
  licence: {file: ./licence.txt}
"""


def test_builds(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("BASE", "OTHER", "TAG", "WHERE"):
        monkeypatch.setenv(name, "given")
    (tmp_path / "docker-compose.yml").write_text(WRITTEN)
    source, problems = read_application(tmp_path / "docker-compose.yml", Access(passed=("BASE",)))
    assert source is not None, problems
    assert checked_builds(source)[1] == []
    assert checked_builds(source)[0] == {
        "services": {
            "a": {
                "build": {
                    "context": f"{tmp_path}/app",
                    "dockerfile": "Dockerfile.car",
                    "args": {"BASE": "given", "TAG": "1", "COST": "$$5"},
                    "additional_contexts": {"maps": f"{tmp_path}/maps", "remote": "https://a.b/c.git"},
                    "secrets": ["licence"],
                    "shm_size": 2_000_000_000,
                }
            },
            "b": {"build": {"context": str(tmp_path)}},
        },
        "secrets": {"licence": {"file": f"{tmp_path}/licence.txt"}},
    }


@pytest.mark.parametrize(
    ("build", "rest", "says"),
    [
        ({"context": "${OUTSIDE}"}, {}, None),
        ({"context": "${NOPE}/etc"}, {}, "'/etc' is outside the repository"),
        ({"context": "${HERE}/../.."}, {}, "is outside the repository"),
        ({"context": ".", "dockerfile": "${NOPE}../../x"}, {}, "'../../x' is outside the repository"),
        ({"context": ".", "additional_contexts": ["a=${NOPE}/root"]}, {}, "'/root' is outside the repository"),
        ({"context": ".", "additional_contexts": {"a": "${NOPE}/root"}}, {}, "'/root' is outside the repository"),
        ({"context": ".", "network": "${NOPE}host"}, {}, "a build of 'a' on the network 'host'"),
        ({"context": "${NOPE:?set it}"}, {}, "the build of 'a': variable NOPE is not set: set it"),
        ({"context": "git@/../../x"}, {}, "is outside the repository"),
        ({"context": "github.com/etc"}, {}, "is a symbolic link to '/etc', outside the repository"),
        ({"context": "."}, {"file": "${NOPE}/etc/shadow"}, "'/etc/shadow' is outside the repository"),
        ({"context": "."}, {"file": "${OUTSIDE}/config.json"}, "'/config.json' is outside the repository"),
        ({"context": "."}, {"environment": "${NOPE}CI_JOB_TOKEN"}, "belongs to the pipeline"),
        ({"context": "."}, {"file": "${NOPE:?x}"}, "the secrets: variable NOPE is not set: x"),
    ],
)
def test_paths_that_only_the_builder_would_see(
    build: dict[str, Any], rest: dict[str, str], says: str | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A variable that the application does not get is empty, and what then is no file of it is refused."""
    monkeypatch.setenv("OUTSIDE", "/etc")
    (tmp_path / "dodo.yml").touch()
    (tmp_path / ".env").write_text("HERE=.\n")
    (tmp_path / "github.com").mkdir()
    (tmp_path / "github.com" / "etc").symlink_to("/etc")
    document = {"services": {"a": {"build": build, "command": "--cid=111"}}, "secrets": {"s": rest} if rest else {}}
    (tmp_path / "docker-compose.yml").write_text(yaml.safe_dump(document))
    source, problems = read_application(tmp_path / "docker-compose.yml", Access())
    if source is not None:
        builds, problems = checked_builds(source)
        if says is None:
            assert builds["services"]["a"]["build"]["context"] == str(tmp_path)
    assert [says in problem.message for problem in problems if problem.severity == "error" and says] == (
        [] if says is None else [True]
    )
