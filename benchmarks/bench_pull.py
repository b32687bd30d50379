"""A cold pull of all services' images: shared layers beside one independent image a service.

First the largest of all images as it lies on the engine. Then pushes DoDo's images (``dodo images build``) to an image
separate registry on 127.0.0.1, once as they are and once flattened to one layer each, and pulls both into an empty
engine. Root on Debian with docker.io and docker-registry.
"""

import contextlib
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # this checkout

from players import IMAGES, engine_problem

from benchmarks.ledger.row import Goal, Row, attempt, cost_row, plan, report
from dodo_dsl import __version__

PORT = 5917
BRIDGE = "dodo-bench"
HOST = f"127.0.0.1:{PORT}"
NAMES = [name for name in IMAGES if name != "clock"]
LARGEST, PULL, SECONDS = "largest image, unpacked", "cold pull of the suite", "cold pull, seconds"
GOALS = {LARGEST: Goal(250, of="value"), PULL: Goal(1.15, of="value")}
UNITS = {LARGEST: "MB", PULL: "x the largest image", SECONDS: "s"}
MANIFEST = "application/vnd.docker.distribution.manifest.v2+json"


def docker(*words: str, host: str = "") -> str:
    command = ["docker", *(["-H", host] if host else []), *words]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout.strip()


@contextlib.contextmanager
def process(*command: str, answers: list[str]) -> Iterator[None]:
    """A process that runs until the block ends; the block begins when ``answers`` succeeds."""
    running = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        for _ in range(300):
            if subprocess.run(answers, capture_output=True, check=False).returncode == 0:
                break
            time.sleep(0.1)
        yield
    finally:
        running.terminate()
        running.wait()


@contextlib.contextmanager
def image_registry(folder: Path) -> Iterator[None]:
    config = folder / "registry.yml"
    storage = f"filesystem: {{rootdirectory: {folder / 'registry'}}}"
    config.write_text(f"version: 0.1\nlog: {{level: error}}\nstorage: {{{storage}}}\nhttp: {{addr: '{HOST}'}}\n")
    with process("docker-registry", "serve", str(config), answers=["bash", "-c", f": >/dev/tcp/127.0.0.1/{PORT}"]):
        yield


@contextlib.contextmanager
def empty_engine(folder: Path) -> Iterator[str]:
    root = Path(tempfile.mkdtemp(dir=folder))
    host = f"unix://{root}/docker.sock"
    flags = [f"--data-root={root}/data", f"--exec-root={root}/exec", f"--pidfile={root}/pid", f"--host={host}"]
    rest = [f"--bridge={BRIDGE}", "--iptables=false", "--max-concurrent-downloads=3"]
    with bridge(), process("dockerd", *flags, *rest, answers=["docker", "-H", host, "info"]):
        yield host


@contextlib.contextmanager
def bridge() -> Iterator[None]:
    """A network bridge for the empty engine: with none, it would remove docker0, which is the other engine's."""
    subprocess.run(["ip", "link", "add", BRIDGE, "type", "bridge"], check=True)
    try:
        subprocess.run(["ip", "address", "add", "192.0.2.1/24", "dev", BRIDGE], check=True)  # RFC 5737
        yield
    finally:
        subprocess.run(["ip", "link", "delete", BRIDGE], check=False)


def push(kind: str, name: str) -> None:
    target = f"{HOST}/{kind}/{name}:1"
    source = f"dodo/{name}:{__version__}"
    try:
        if kind == "shared":
            docker("tag", source, target)
        else:
            flatten(source, target)
        docker("push", "-q", target)
    finally:
        docker("image", "rm", target)


def flatten(source: str, target: str) -> None:
    container = docker("create", source, "true")
    try:
        flat = ["bash", "-c", 'docker export "$1" | docker import - "$2"', "flat", container, target]
        subprocess.run(flat, check=True, capture_output=True)
    finally:
        docker("rm", container)


def manifest(kind: str, name: str) -> list[dict[str, Any]]:
    """The layers of one image in the registry."""
    request = urllib.request.Request(f"http://{HOST}/v2/{kind}/{name}/manifests/1", headers={"Accept": MANIFEST})
    with urllib.request.urlopen(request) as answer:
        found: list[dict[str, Any]] = json.load(answer)["layers"]
    return found


def layers(kind: str) -> dict[str, int]:
    """Compressed bytes by layer of all images of a kind."""
    return {layer["digest"]: layer["size"] for name in NAMES for layer in manifest(kind, name)}


def largest(kind: str) -> int:
    """Compressed bytes of the largest image."""
    return max(sum(layer["size"] for layer in manifest(kind, name)) for name in NAMES)


def cold_pull(kind: str, folder: Path) -> float:
    with empty_engine(folder) as host:
        start = time.perf_counter()
        for name in NAMES:
            docker("pull", "-q", f"{HOST}/{kind}/{name}:1", host=host)
        return time.perf_counter() - start


def largest_here() -> None:
    """The largest unpacked image of DoDo on the engine."""
    tag = f"dodo/*:{__version__}"
    images = docker("image", "ls", "--filter", f"reference={tag}", "--format", "{{.Repository}}:{{.Tag}}").split()
    sizes = {image: int(docker("image", "inspect", "--format", "{{.Size}}", image)) / 1e6 for image in images}
    name = max(sizes, key=lambda image: sizes[image], default="")
    note = f"{name} of {len(sizes)}" if name else f"there is no image {tag} (dodo images build)"
    row = cost_row(LARGEST, UNITS[LARGEST], [sizes[name]] if name else [], goal=GOALS[LARGEST], note=note)
    report(row)
    print(f"largest image: {note}, {sizes.get(name, 0):.0f} MB unpacked")


def pulls(folder: Path) -> None:
    found: dict[str, float] = {}
    for kind in ("shared", "alone"):
        for service in NAMES:
            push(kind, service)
        found[kind], size = cold_pull(kind, folder), sum(layers(kind).values())
        times = size / largest(kind)
        print(f"{kind:<7} {size / 1e6:7.1f} MB in {len(layers(kind))} layers, {found[kind]:5.1f} s;", end=" ")
        print(f"{times:.3f} times the largest image")
        if kind == "shared":
            report(cost_row(PULL, UNITS[PULL], [times], goal=GOALS[PULL]))
    report(cost_row(SECONDS, UNITS[SECONDS], [found["shared"]], "independent images", [found["alone"]]))


def main() -> int:
    planned = [Row(what, unit, goal=GOALS.get(what), less=True) for what, unit in UNITS.items()]
    plan(*planned)
    if problem := engine_problem(NAMES):
        plan(*planned, note=problem)
        print(f"{problem}: nothing to measure")
        return 0
    with attempt(planned[0]):
        largest_here()
    needed = [name for name in ("docker-registry", "dockerd", "ip") if not shutil.which(name)]
    if os.getuid() or needed:
        plan(*planned[1:], note=f"needs {'root' if os.getuid() else needed[0]}")
        return 0
    with (
        tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as name,
        attempt(*planned[1:]),
        image_registry(Path(name)),
    ):
        pulls(Path(name))
    return 0


if __name__ == "__main__":
    sys.exit(main())
