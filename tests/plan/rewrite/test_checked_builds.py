"""The application's builds, as they are checked."""

from pathlib import Path

import pytest

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
    assert checked_builds(source) == {
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
