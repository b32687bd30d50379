"""``application-memory`` and ``application-pictures`` beyond their examples in the catalogue."""

import shutil
from pathlib import Path

import pytest

from dodo_dsl import package_data
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


SIZED = "environment: {camera: {uses: virtual-camera, with: {map-path: ../maps/plain, width: 1280, height: 720}}}\n"


@pytest.mark.parametrize(
    ("command", "messages"),
    [
        ("--name=video0.argb --width=1280 --height=720", []),
        ("--name=video0.argb", []),
        ("--name=other --width=640 --height=480", []),
        (
            "--name video0.argb --width 640 --height 480",
            ["'driver' asks for frames of 640 x 480 pixels, and 'camera' makes them of 1280 x 720"],
        ),
        (
            "--name=/video0.argb --width=${W:-640}",
            ["'driver' asks for frames of 640 x 720 pixels, and 'camera' makes them of 1280 x 720"],
        ),
        (
            "--name.bgr=video0.argb",
            ["'driver' asks for 'video0.argb' as bgr with 3 bytes a pixel, and 'camera' makes it argb with 4"],
        ),
    ],
)
def test_pictures_are_as_the_application_asks_for_them(command: str, messages: list[str], tmp_path: Path) -> None:
    written = SIZED + example(f'driver: {{image: driver, command: "--cid=111 {command}"}}')
    problems = list(wiring_rules.check_pictures(context(written, tmp_path)))
    assert [problem.message.removeprefix("the application's ") for problem in problems] == messages
    assert {(problem.rule, problem.severity) for problem in problems} <= {("application-pictures", "warning")}
    if "pixels" in "".join(messages):
        assert problems[0].span.file.endswith("example.dodo.yml") and "--width=1280 --height=720" in problems[0].hint


def test_pictures_of_a_recording_have_its_size(tmp_path: Path) -> None:
    (tmp_path / "tests/recordings").mkdir(parents=True)
    shutil.copy(package_data.registry() / "recordings/static-rig.rec", tmp_path / "tests/recordings/own.rec")
    replay = (
        "level: dil\nkind: open-loop\nenvironment: {camera: {uses: rec-replay, with: {rec: ../recordings/own.rec}}}\n"
    )
    written = replay + example(
        'driver: {image: driver, command: "--cid=111 --name=video0.argb --width=64 --height=48"}'
    )
    (problem,) = wiring_rules.check_pictures(context(written, tmp_path))
    assert problem.message.endswith("frames of 64 x 48 pixels, and 'camera' makes them of 640 x 480")
    assert problem.hint == "write --width=640 --height=480 in the command of 'driver'"
