"""Specs as they are written, instance by instance."""

from pathlib import Path

import pytest

from dodo_dsl.spec.load import load_spec
from dodo_dsl.spec.model import ResourceLimits, Spec
from dodo_dsl.spec.registry import Location
from tests.check import examples


def loaded(folder: Path, text: str) -> tuple[list[Spec], list[str]]:
    path = folder / "example" / "example.dodo.yml"
    path.parent.mkdir(exist_ok=True)
    path.write_text(text)
    specs, problems = load_spec(Location(path, folder))
    return specs, [problem.rule for problem in problems]


def test_a_spec(tmp_path: Path) -> None:
    more = "seed: 7\nisolation: host\nrecord: {frames: 2 Hz}\n"
    (spec,), problems = loaded(tmp_path, examples.SPEC.replace("60 s", "1.5 min") + more)
    assert problems == []
    assert (spec.name, spec.level, spec.kind, spec.clock) == ("example", "sil", "closed-loop", "realtime")
    assert (spec.timeout_s, spec.seed, spec.isolation, spec.frames_hz, spec.rig) == (90.0, 7, "host", 2.0, None)
    assert [(use.layer, use.name, use.uses.text) for use in spec.uses] == [
        ("environment", "camera", "virtual-camera"),
        ("action", "vehicle", "dynamic-model"),
        ("action", "pose", "integrator"),
        ("evaluation", "track", "collision"),
    ]
    assert (spec.title, spec.slug, spec.is_whole) == ("example", "example", True)
    assert spec.span("timeout").line == 6
    assert spec.span("rig").line == 1


@pytest.mark.parametrize(
    ("record", "frames"),
    [
        ("", ("on-failure", None)),
        ("record: {limit: 5 MB}", ("on-failure", None)),
        ("record: {frames: never}", ("never", None)),
        ("record: {rate: 5 Hz}", ("on-failure", 5.0)),
        ("record: {frames: always, rate: 5 Hz}", ("always", 5.0)),
        ("record: {frames: 5 Hz}", ("always", 5.0)),
    ],
)
def test_when_pictures_are_kept(tmp_path: Path, record: str, frames: tuple[str, float | None]) -> None:
    (spec,), problems = loaded(tmp_path, f"{examples.SPEC}{record}\n")
    assert (problems, (spec.frames, spec.frames_hz)) == ([], frames)


@pytest.mark.parametrize(
    ("resources", "expected", "problems"),
    [
        ("", None, []),
        ("resources: {max-memory: 0.2 GB}", ResourceLimits(200.0), []),
        (
            "resources: {max-processor-time: 500 ms, max-processor-share: 50 %}",
            ResourceLimits(None, 0.5, 0.5),
            [],
        ),
        ("resources: {max-memory: 1 kB}", ResourceLimits(), ["out-of-range"]),
        ("resources: {max-memory: 200}", ResourceLimits(), ["wrong-unit"]),
        ("resources: {memory: 200 MB}", ResourceLimits(), ["unknown-key"]),
        ("resources: {}", None, ["missing-key"]),
    ],
)
def test_limits_of_resources(
    tmp_path: Path, resources: str, expected: ResourceLimits | None, problems: list[str]
) -> None:
    (spec,), found = loaded(tmp_path, f"{examples.SPEC}{resources}\n")
    assert (spec.resources, found) == (expected, problems)
