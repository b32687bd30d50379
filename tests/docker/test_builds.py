"""What a run builds replaces no image of the engine, whatever name the application's file asks for."""

import contextlib
import secrets
from pathlib import Path

import pytest
import yaml

from dodo_dsl.run.docker.client import connect
from tests.docker.compose import IMAGE
from tests.docker.test_started_anywhere import WITHOUT_COLON
from tests.drive.applications import dodo, results
from tests.drive.variants import registry, variant

pytestmark = [pytest.mark.engine, pytest.mark.usefixtures("images")]


def test_an_image_keeps_what_its_name_stands_for(tmp_path: Path) -> None:
    """In a folder with an odd name."""
    tmp_path /= WITHOUT_COLON
    tmp_path.mkdir()
    spec = variant(registry(tmp_path), "sil-closed-straight", "sil-built")
    name = f"dodo-test-{secrets.token_hex(3)}:1"
    (tmp_path / "Dockerfile").write_text(f'FROM {IMAGE}\nENTRYPOINT ["sh", "-c", "echo it is built; sleep 1"]\n')
    compose = tmp_path / "docker-compose.yml"
    compose.write_text(yaml.safe_dump({"services": {"a": {"build": ".", "image": name}, "b": {"image": name}}}))
    with contextlib.closing(connect()) as client:
        before = client.images.get(IMAGE)
        before.tag(*name.split(":"))
        try:
            words = ("--application", str(compose), "--backend", "docker", "--report", str(tmp_path / "report"))
            dodo("run", str(spec), *words, "--retry-errors", "2", code=1)  # the engine may be too busy to start it
            assert client.images.get(name).id == before.id
        finally:
            client.images.remove(name)
    (test,) = results(tmp_path / "report").values()
    assert test["outcome"] == "failed", test
    logs = tmp_path / "report" / "sil-built" / "logs"
    assert {(logs / f"application.{service}.log").read_text() for service in "ab"} == {"it is built\n"}
