"""An engine of the tests' own, as a service of a pipeline's job is: another network, and files of its own."""

import contextlib
import os
import secrets
import shutil
import signal
import subprocess
import tempfile
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

import pytest

from tests.run.docker.engine_stub import make_certificates

PORT = 2375
PATIENCE_S = 60.0
_PROGRAMS = ("dockerd", "ip", "nsenter", "unshare")


@contextlib.contextmanager
def own_engine(hidden: Sequence[Path] = (), tls: bool = False) -> Iterator[dict[str, str]]:
    """The variables that lead clients to it; it does not see what is in the folders ``hidden``.

    It is in a network namespace of its own, so that it changes no rule of the machine's firewall. Only root makes one.
    """
    if os.geteuid() != 0 or not all(shutil.which(program) for program in _PROGRAMS):
        pytest.skip(f"only root makes an engine, of {', '.join(_PROGRAMS)}")
    name = f"dodo{secrets.token_hex(3)}"
    network = f"10.99.{secrets.randbelow(250)}"
    near, far = f"{network}.1", f"{network}.2"
    folder = Path(tempfile.mkdtemp(prefix="dodo-engine-", dir="/tmp"))
    words = ["--data-root", str(folder / "data"), "--exec-root", str(folder / "exec"), "--pidfile", str(folder / "pid")]
    words += ["--host", f"tcp://{far}:{PORT}"]
    variables = {"DOCKER_HOST": f"tcp://{far}:{PORT}"}
    if tls:
        own = make_certificates(folder / "certs", far)
        words += ["--tlsverify", "--tlscacert", f"{own}/ca.pem", "--tlscert", f"{own}/cert.pem"]
        words += ["--tlskey", f"{own}/key.pem"]
        variables |= {"DOCKER_TLS_VERIFY": "1", "DOCKER_CERT_PATH": str(own)}
    hide = "".join(f"mount -t tmpfs none '{path}'; " for path in hidden)
    starts = ["nsenter", f"--net=/run/netns/{name}", "unshare", "--mount", "--propagation", "private", "sh", "-ec"]
    with contextlib.ExitStack() as stack:
        stack.callback(_ip, "netns", "del", name)
        _ip("netns", "add", name)
        _ip("link", "add", name, "type", "veth", "peer", "name", "eth0", "netns", name)
        _ip("addr", "add", f"{near}/30", "dev", name)
        _ip("link", "set", name, "up")
        for line in (f"addr add {far}/30 dev eth0", "link set eth0 up", "link set lo up"):
            _ip("-n", name, *line.split())
        log = stack.enter_context((folder / "log").open("wb"))
        command = [*starts, f'{hide}exec dockerd "$@"', "dockerd", *words]
        process = subprocess.Popen(command, stdout=log, stderr=log, stdin=subprocess.DEVNULL)
        stack.callback(_end, process, folder)
        _wait(process, variables, folder / "log")
        yield variables


def _ip(*words: str) -> None:
    subprocess.run(["ip", *words], check=True, capture_output=True)


def _wait(process: "subprocess.Popen[bytes]", variables: dict[str, str], log: Path) -> None:
    deadline = time.monotonic() + PATIENCE_S
    asks, environment = ["docker", "version"], {**os.environ, **variables}
    while subprocess.run(asks, env=environment, capture_output=True, check=False).returncode:
        if process.poll() is not None or time.monotonic() > deadline:
            pytest.skip(f"an engine of its own does not start here: {log.read_text()[-300:]}")
        time.sleep(0.3)


def _end(process: "subprocess.Popen[bytes]", folder: Path) -> None:
    process.send_signal(signal.SIGTERM)
    process.wait(PATIENCE_S)
    mounts = [line.split()[1] for line in Path("/proc/mounts").read_text().splitlines()]
    for path in sorted((m for m in mounts if m.startswith(f"{folder}/")), reverse=True):
        subprocess.run(["umount", "--lazy", path], check=False)
    shutil.rmtree(folder, ignore_errors=True)
