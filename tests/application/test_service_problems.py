"""Problems of single services of a compose file."""

import pytest

from dodo_dsl.application.application_problems import unknown_keys
from tests.application.applications import problems
from tests.source.nodes import mapping

DROPPED = {"car": "it needs profile car"}


def found(service: str, name: str = "a", more: str = "") -> list[tuple[str, str]]:
    """Rules and messages about a service, beside one that takes a CID."""
    text = f"services: {{b: {{image: x, command: --cid=1, container_name: eyes}}, {name}: {{{service}}}}}\n{more}"
    return [(problem.rule, problem.message) for problem in problems(text, dropped=DROPPED)]


FILE = {
    "command: prog": "'a' has neither 'image' nor 'build', so it cannot be started",
    'image: x, command: "prog \'open"': "'command' of 'a': unclosed quotation mark",
    "image: x, entrypoint: (prog)": "'entrypoint' of 'a': parenthesis outside quotes, but compose starts no shell",
    "image: x, depends_on: [c]": "'depends_on' of 'a' names the unknown service 'c'",
    "image: x, volumes_from: [car]": "'car', whose volumes 'a' uses, does not start: it needs profile car",
    "image: Team/x:A": "the image 'Team/x:A' has capitals, which no engine takes in its name",
    "image: r.x:5/a/B": "the image 'r.x:5/a/B' has capitals, which no engine takes in its name",
    f"image: x, hostname: {'h' * 65}": "'hostname' of 'a' has 65 bytes, and Linux takes 64",
    f"image: x, domainname: {'d' * 65}": "'domainname' of 'a' has 65 bytes, and Linux takes 64",
    f"image: x, environment: [A={'1' * 131070}]": "'A' of 'a' has 131,072 bytes, expected fewer than 131,072",
    f"image: x, command: [{'x' * 131072}]": "'command' of 'a' has 131,072 bytes, expected fewer than 131,072",
    "image: x, volumes: ['v:/d']": "compose takes 'v:' of 'v:/d' for a drive of Windows, and mounts no volume",
    "image: x, scale: 3": "'a' has 3 replicas, but starts once in a test",
    "image: x, deploy: {replicas: 2}": "'a' has 2 replicas, but starts once in a test",
}
ISOLATION = {
    "image: x, ipc: 'container:c'": "'ipc' joins the container 'c', which is not part of the application",
    "image: x, pid: host": "'pid: host' gives access to the processes of all tests",
    "image: x, use_api_socket: true": "'use_api_socket' gives access to the Docker engine",
    "image: x, volumes: ['/:/host']": "'/' belongs to the host, so tests would share it",
    "image: x, external_links: [c]": "'c' is a container outside the application",
    "image: x, volumes_from: ['container:c']": "the container 'c' is not part of the application",
    "image: x, volumes: ['shared:/s']": "volume 'shared' is external, so tests would share it",
}
HARDWARE = {
    "image: x, privileged: true": "'privileged' of 'a'",
    "image: x, devices: [/dev/video0]": "device '/dev/video0' of 'a'",
    "image: x, devices: [{source: /dev/video0}]": "device '/dev/video0' of 'a'",
    "image: x, volumes: ['/dev/bus:/dev/bus']": "'/dev/bus' of 'a'",
    "image: x, cap_add: [sys_time]": "capability 'sys_time' of 'a'",
}


@pytest.mark.parametrize(
    "service",
    [
        *("image: 'R.x:5/a/b:A'", "image: 'a@sha256:ABC'", "image: '$I'", f"image: x, hostname: {'h' * 64}"),
        f"image: x, environment: [A={'1' * 131069}]",
    ],
)
def test_what_an_engine_takes(service: str) -> None:
    assert [message for rule, message in found(service) if rule == "application-file"] == []


@pytest.mark.parametrize("service", FILE)
def test_what_cannot_be_used(service: str) -> None:
    assert found(service) == [("application-file", FILE[service])]


@pytest.mark.parametrize("service", ISOLATION)
def test_what_cannot_be_isolated(service: str) -> None:
    expected = [("application-isolation", ISOLATION[service])]
    assert found(service, more="volumes: {shared: {external: true}}\n") == expected


@pytest.mark.parametrize("service", HARDWARE)
def test_hardware(service: str) -> None:
    without = "is left out of sil and dil tests, which have no hardware"
    assert found(service) == [("application-hardware", f"{HARDWARE[service]} {without}")]


@pytest.mark.parametrize(
    "service",
    [
        'build: "${HERE:-.}"',
        "x-dodo-process: [prog]",
        "image: x, ipc: 'container:eyes', volumes_from: ['container:eyes'], network_mode: 'service:b'",
        "image: x, depends_on: [car], pid: 'service:b', cap_add: [SYS_NICE]",
        "image: x, volumes: ['shared:/s:ro', '/sys/class:/p:ro']",
    ],
)
def test_good_ones(service: str) -> None:
    assert found(service, more="volumes: {shared: {external: true}}\n") == []


@pytest.mark.parametrize("name", ["sandbox", "dodo-clock"])
def test_reserved_names(name: str) -> None:
    expected = [("application-file", f"the name '{name}' is reserved for DoDo's own services")]
    assert found("image: x", name) == expected


def test_unknown_keys() -> None:
    service = mapping("{x-dodo: {}, x-dodo-process: [a], x-dodo-x: 1, x-dod: 1, x-docs: 1, x-own: 1}")
    assert [(problem.severity, problem.message) for problem in unknown_keys(service)] == [
        ("error", "unknown key 'x-dodo-x'"),
        ("warning", "neither compose nor DoDo uses the key 'x-dod'"),
        ("warning", "neither compose nor DoDo uses the key 'x-docs'"),
    ]
