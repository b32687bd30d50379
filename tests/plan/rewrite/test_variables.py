"""The variables of .env files that a compiled test carries."""

from pathlib import Path

import pytest

from dodo_dsl.application.read import read_application
from dodo_dsl.plan.rewrite.rewrite import carried

COMPOSE = """\
services:
  driver:
    image: driver:${TAG}
    command: --cid=${CID} --maps=${MAPS}
    environment: [NAMED, "GREETING=hello ${WHOM}"]
    env_file: car.env
    build: {context: ., args: {BASE: }}
secrets:
  token: {environment: FROM_OUTSIDE}
"""


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("TAG=v1", {"TAG": "v1"}),
        ("NAMED=x", {"NAMED": "x"}),
        ("BASE=debian", {"BASE": "debian"}),
        ("FROM_OUTSIDE=x", {"FROM_OUTSIDE": "x"}),
        ("IN_FILE=x", {"IN_FILE": "x"}),
        ("WHOM=${NAME}\nNAME=x", {"WHOM": "${NAME}", "NAME": "x"}),
        ("UNUSED=x", {}),
        ("TAG=x://a:b@c", {}),
        ("MY_TOKEN=x\nWHOM=${MY_TOKEN}", {"WHOM": "${MY_TOKEN}"}),
        ("CID=111", {"CID": "140"}),
        ("DODO_SUBNET=x\nCOMPOSE_FILE=y", {}),
        ("MAPS=./maps", {"MAPS": "../../maps"}),
    ],
)
def test_what_is_carried(line: str, expected: dict[str, str], tmp_path: Path) -> None:
    (tmp_path / "docker-compose.yml").write_text(COMPOSE)
    (tmp_path / ".env").write_text(f"{line}\n")
    (tmp_path / "car.env").write_text("A=${IN_FILE}\n")
    source, problems = read_application(tmp_path / "docker-compose.yml")
    assert source is not None, problems
    assert {"CID": "140", **carried(source, 140, "../..", {"MAPS"})} == {"CID": "140", **expected}
