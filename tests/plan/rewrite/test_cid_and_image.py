"""CIDs and images of copied services."""

from typing import Any

import pytest

from dodo_dsl.plan.rewrite.service_copy import assign_cid, assign_image
from tests.plan.rewrite.copies import copy


@pytest.mark.parametrize(
    ("service", "image"),
    [
        ({"image": "x:1"}, "${DODO_IMAGE_A:-x:1}"),
        ({"build": "."}, "${DODO_IMAGE_A:-}"),
        ({"x-dodo-process": ["a"]}, None),
    ],
)
def test_images(service: dict[str, Any], image: str | None) -> None:
    own = copy(service)
    assign_image(own)
    assert own.service.get("image") == image
    assert bool(own.changes) is (image is not None)


@pytest.mark.parametrize(
    ("service", "changed", "notes"),
    [
        ({"command": "p --cid=111"}, {"command": "p --cid=140"}, ["a: command: --cid=140"]),
        ({"command": ["p", "--cid", 111]}, {"command": ["p", "--cid", "140"]}, ["a: command: --cid=140"]),
        ({"entrypoint": "p", "command": "-v"}, {"entrypoint": "p", "command": "-v"}, []),
        ({"environment": ["CID=111", "X=1"]}, {"environment": ["CID=140", "X=1"]}, ["a: environment: CID=140"]),
        ({"environment": {"CID": 111, "X": 1}}, {"environment": {"CID": "140", "X": 1}}, ["a: environment: CID=140"]),
        ({"environment": ["ARGS=--cid=1"]}, {"environment": ["ARGS=--cid=140"]}, ["a: environment: --cid=140 in ARGS"]),
        ({"healthcheck": {"test": "p --cid=1"}}, {"healthcheck": {"test": "p --cid=140"}}, []),
        ({"healthcheck": {"disable": True}}, {"healthcheck": {"disable": True}}, []),
    ],
)
def test_cids(service: dict[str, Any], changed: dict[str, Any], notes: list[str]) -> None:
    own = copy(service)
    assign_cid(own, ())
    assert (own.service, own.changes) == (changed, notes)


@pytest.mark.parametrize(
    ("written", "changed"),
    [
        (None, {"OD4SESSION_CID": "140"}),
        (["X=1"], ["X=1", "OD4SESSION_CID=140"]),
        ({"OD4SESSION_CID": None}, {"OD4SESSION_CID": "140"}),
    ],
)
def test_cids_of_environment_files(written: Any, changed: Any) -> None:
    own = copy({"environment": written})
    assign_cid(own, ("OD4SESSION_CID",))
    assert own.service["environment"] == changed
    assert own.changes == ["a: environment: OD4SESSION_CID=140"]
