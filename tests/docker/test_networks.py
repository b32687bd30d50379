"""The network of a test: its containers hear one another's multicast, and reach neither the host nor others."""

import ipaddress
import json
import os
import subprocess
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
import yaml

from dodo_dsl.application.model import Access
from dodo_dsl.emit.render import render_plan
from dodo_dsl.plan.model import Application
from tests.docker.compose import IMAGE, Crate
from tests.run.scripted import plan

pytestmark = [pytest.mark.engine, pytest.mark.usefixtures("images")]

SUBNETS = [f"10.213.{third}.{fourth}/28" for third in range(230, 240) for fourth in range(0, 256, 16)]
TALK = """
import errno, json, socket, threading, time
GROUP = ("225.0.0.111", 12175)
heard = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
heard.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
heard.bind(GROUP)
heard.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, socket.inet_aton(GROUP[0]) + bytes(4))
me = socket.gethostname().encode()

def say():
    sender = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    while True:
        sender.sendto(me, GROUP)
        time.sleep(0.05)

def reaches(address):
    with socket.socket() as one:
        one.settimeout(5)
        return one.connect_ex((address, 9)) in (0, errno.ECONNREFUSED)

threading.Thread(target=say, daemon=True).start()
names = set()
while len(names) < 2:
    names.add(heard.recv(100))
print(json.dumps({"gateway": reaches(GATEWAY), "host": reaches(HOST)}), flush=True)
time.sleep(4)
"""


def networks(outside: bool) -> object:
    """The networks of a compiled test."""
    application = Application(".", (), access=Access(outside=outside))
    made = plan("t", services=(), subnet=SUBNETS[0], application=application)
    texts = {file.path: file.text for file in render_plan(made)}
    return yaml.safe_load(texts["t/environment.compose.yml"])["networks"]


def host() -> str:
    """An address of the engine's machine on another of its networks; a new engine names only that network's subnet."""
    words = ["docker", "network", "inspect", "bridge", "--format", "{{json (index .IPAM.Config 0)}}"]
    found = json.loads(subprocess.run(words, capture_output=True, text=True, check=True).stdout)
    return str(found.get("Gateway") or next(ipaddress.ip_network(found["Subnet"]).hosts()))


def up(folder: Path, project: str, outside: bool, subnets: Sequence[str]) -> subprocess.CompletedProcess[str]:
    """What two containers say, in the first subnet that is free: an interrupted run may have left its network."""
    file = folder / "docker-compose.yml"
    compose = ["docker", "compose", "-p", project, "-f", str(file)]
    for subnet in subnets:
        gateway = str(next(ipaddress.ip_network(subnet).hosts()))
        script = f"HOST, GATEWAY = {host()!r}, {gateway!r}\n{TALK}".replace("$", "$$")
        service = {"image": IMAGE, "entrypoint": ["python3", "-c", script], "stop_grace_period": "0s"}
        file.write_text(yaml.safe_dump({"services": {"a": service, "b": service}, "networks": networks(outside)}))
        environment = os.environ | {"DODO_SUBNET": subnet}
        words = [*compose, "up", "--no-log-prefix"]
        try:
            done = subprocess.run(words, capture_output=True, text=True, check=False, timeout=120, env=environment)
        finally:
            subprocess.run([*compose, "down", "-v"], capture_output=True, check=True, env=environment)
        if "overlaps" not in done.stderr:
            return done
    pytest.fail(f"no subnet is free: {done.stderr}")


def test_what_containers_reach(tmp_path: Path, crate: Crate) -> None:
    """Without and with a way out, both at once."""

    def found(outside: bool) -> subprocess.CompletedProcess[str]:
        folder = tmp_path / f"net-{outside}"
        folder.mkdir()
        subnets = SUBNETS[outside::2]
        return up(folder, f"dodo-{crate.mark}-{folder.name}".lower(), outside, subnets)

    with ThreadPoolExecutor() as pool:
        for outside, done in zip((False, True), pool.map(found, (False, True)), strict=True):
            said = [json.loads(line[line.index("{") :]) for line in done.stdout.splitlines() if "{" in line]
            assert said == 2 * [{"gateway": outside, "host": outside}], done.stdout + done.stderr
