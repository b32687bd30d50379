"""``application-memory`` beyond its example in the catalogue."""

from pathlib import Path

import pytest

from dodo_dsl.check import wiring_rules
from tests.check.contexts import context


def example(*services: str) -> str:
    return "# docker-compose.yml\nservices:\n" + "".join(f"  {service}\n" for service in services)


def hints(folder: Path, *services: str) -> list[str]:
    return [diagnostic.hint for diagnostic in wiring_rules.check_memories(context(example(*services), folder))]


@pytest.mark.parametrize(
    ("command", "hint"),
    [
        ("--cid=111 --name=vido0.argb", "did you mean 'video0.argb'?"),
        ("--cid=111 --name.i420=/video9.i420", "did you mean 'video0.i420'?"),
        ("--cid=111 --name=video0.bgr", "write 'name.bgr: video0.bgr' under 'with' of 'camera'"),
        ("--cid=111 --name=/img.rgb", "write 'name.rgb: img.rgb' under 'with' of 'camera'"),
        ("--cid=111 --name=img.argb", "write 'name.argb: img.argb' under 'with' of 'camera'"),
        ("--cid=111 --name=pictures", "the test makes video0.argb, video0.i420"),
        ("--cid=111 --name=${MEMORY:-pictures}", "the test makes video0.argb, video0.i420"),
    ],
)
def test_a_memory_that_nobody_makes_is_named_with_those_there_are(command: str, hint: str, tmp_path: Path) -> None:
    assert hints(tmp_path, f'driver: {{image: driver, command: "{command}"}}') == [hint]


@pytest.mark.parametrize(
    "services",
    [
        ('driver: {image: driver, command: "--cid=111 --name=/video0.argb"}',),
        ('driver: {image: driver, command: "--cid=111 --name.in=video0.argb --name.out=seen"}',),
        ('driver: {image: driver, command: "--cid=111 --name=${MEMORY}"}',),
        (
            'decoder: {image: decoder, command: ["--cid=111", "--name=seen"]}',
            'driver: {image: driver, command: ["--cid=111", "--name=seen"]}',
        ),
    ],
)
def test_nothing_is_said_of_memories_that_may_be_made(services: tuple[str, ...], tmp_path: Path) -> None:
    assert hints(tmp_path, *services) == []
