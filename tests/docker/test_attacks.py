"""An application in a container attacks the machine, as the image's user and as the container's root."""

import ast
import json
import shutil
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest
import yaml

from tests.docker.compose import IMAGE
from tests.drive.applications import dodo, results
from tests.drive.variants import registry, variant
from tests.hostile import attacks

pytestmark = [pytest.mark.engine, pytest.mark.usefixtures("images")]

OF_ITS_IMAGE = {"read-cgroups", "read-log", "read-modules", "read-run", "read-var-lib", "write-temporary"}
"""What every container has of its own, and of the kernel's to read."""
OF_ITS_ENGINE = {"call-io_uring_setup", "call-ptrace", "socket-to-the-hypervisor"}
"""What the engine's filter of system calls allows, by its version: docs/reference/sandbox.md says so."""
OF_ITS_NETWORK = {"other-devices-of-the-network", "sends-to-the-networks-of-the-machine"}
"""The test's own device, from which nothing gets any further: see test_networks."""
WHERE_THERE_ARE_NONE = {"takes-the-place-of-folders-of-services"}
"""DoDo's services are containers of their own here, with nothing of the machine mounted below the shared ``/tmp``."""
OF_ITS_ROOT = {
    *("becomes-root", "becomes-root-in-a-saved-id", "is-root", "changes-groups", "has-groups-of-root"),
    *("has-capabilities", "call-chroot", "lease-on-a-file-of-the-machine"),
    *("read-home-of-root", "read-shadow"),
    *(
        f"write-{place}"
        for place in ("devices", "etc", "home", "its-library", "optional", "root", "run", "usr", "usr-folder")
    ),
}
"""What the image's root may do to the image's own files, which nobody else uses."""
CONTAINED = {"root": OF_ITS_IMAGE | OF_ITS_ENGINE | OF_ITS_NETWORK | OF_ITS_ROOT | WHERE_THERE_ARE_NONE}
CONTAINED["user"] = CONTAINED["root"] - OF_ITS_ROOT | {"has-capabilities"}
CASES = [(user, name) for user, contained in CONTAINED.items() for name in sorted({*attacks.ATTACKS} - contained)]
TEST, LONG = "sil-closed-straight", {"track": {"with": {"max-time": "900 s"}}}
MAY_HAVE = sum(1 << number for number in (0, 1, 3, 4, 5, 6, 7, 8, 10))
"""CHOWN, DAC_OVERRIDE, FOWNER, FSETID, KILL, SETGID, SETUID, SETPCAP, NET_BIND_SERVICE: to give up root."""


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> dict[str, dict[str, Any]]:
    """What became of the attacks of one run, by name, and the test itself; by the container's user, both at once."""
    with ThreadPoolExecutor() as pool:
        found = pool.map(lambda user: attacked(user, tmp_path_factory.mktemp(user)), CONTAINED)
        return dict(zip(CONTAINED, found, strict=True))


def attacked(user: str, folder: Path) -> dict[str, Any]:
    spec = variant(registry(folder), TEST, "sil-attacked", clock="realtime", timeout="1000 s", evaluation=LONG)
    (folder / "application").mkdir()
    shutil.copy(attacks.__file__, folder / "application" / "attacks.py")
    service: dict[str, Any] = {
        "image": IMAGE,
        "entrypoint": ["python3", "-u", "/application/attacks.py"],
        "command": "--ends --cid=111 --name=video0.argb",
        "volumes": ["./application:/application:ro"],
    }
    if user == "root":
        service["user"] = "root"
    compose = folder / "docker-compose.yml"
    compose.write_text(yaml.safe_dump({"services": {"stranger": service}}))
    words = ("--application", str(compose), "--backend", "docker", "--report", str(folder / "report"))
    output = dodo("run", str(spec), *words, "--retry-errors", "2", code=1)  # a machine may be too busy to set it up
    (test,) = results(folder / "report").values()
    log = folder / "report" / "sil-attacked" / "logs" / "application.stranger.log"
    assert log.is_file(), output
    rows = [json.loads(line) for line in log.read_text().splitlines() if line.startswith("{")]
    return {"test": test, **{row["attack"]: row for row in rows}}


@pytest.mark.parametrize("user", CONTAINED)
def test_the_test_itself_goes_on(runs: dict[str, dict[str, Any]], user: str) -> None:
    """The test goes on until the application ends, which is then to blame."""
    test = runs[user]["test"]
    assert test["outcome"] == "failed", test
    assert test["reason"].startswith("application service 'stranger' ended with exit code 0"), test


@pytest.mark.parametrize("user", CONTAINED)
def test_capabilities_are_those_to_give_up_root(runs: dict[str, dict[str, Any]], user: str) -> None:
    """A container has no capability but those with which its root becomes another user."""
    sets = ast.literal_eval(runs[user]["has-capabilities"]["how"])
    assert int(sets["CapBnd"], 16) & ~MAY_HAVE == 0
    assert set(sets.values()) == {sets["CapBnd"]}


@pytest.mark.parametrize(("user", "name"), CASES)
def test_it_does_not_get_through(runs: dict[str, dict[str, Any]], user: str, name: str) -> None:
    """An attack on the machine, its files or other tests does not get through."""
    assert not runs[user][name]["through"], runs[user][name]["how"]
