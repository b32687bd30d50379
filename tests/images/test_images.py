"""The images on a real engine: what they are, what they hold, and how they behave where they may do nothing."""

import contextlib
import json
import shutil
import time
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest
import yaml

from dodo_dsl import __version__
from dodo_dsl.cli.images import SHARED
from dodo_dsl.spec.manifest import Manifest, load_manifests
from tests.images.conftest import ROOT, SOURCE, docker, own_volume
from tests.images.targets import folders_of, targets

pytestmark = pytest.mark.engine

MANIFESTS, _ = load_manifests()
HARDENED = ("--read-only", "--cap-drop", "ALL", "--security-opt", "no-new-privileges:true")
MOST_LAYERS, MOST_BYTES = 2, 3_000_000
"""Of a service's own. Design section 9: all images weigh 1.15 times the largest one at most."""

each_service = pytest.mark.parametrize("manifest", MANIFESTS.values(), ids=lambda m: m.name)


def config(reference: str) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(docker("image", "inspect", "--format", "{{json .Config}}", reference))
    return found


def run(reference: str, *words: str, flags: tuple[str, ...] = HARDENED) -> str:
    return docker("run", "--rm", "--network", "none", *flags, "--entrypoint", words[0], reference, *words[1:])


@contextlib.contextmanager
def started(reference: str, volume: str, service: str, *words: str, flags: tuple[str, ...] = ()) -> Iterator[str]:
    """A service in a container as the compiled files start it; taken away at the end."""
    ready = f"test -L /dodo/channel/{service}"
    health = ("--health-cmd", ready, "--health-interval", "500ms", "--health-retries", "1200")
    command = ["run", "--detach", "--init", *HARDENED, *health, "--env", f"DODO_SERVICE={service}"]
    command += ["--env", "DODO_CHANNEL=/dodo/channel", "--tmpfs", "/dodo/channel:mode=1777"]
    container = docker(*command, "--volume", f"{volume}:/tmp", *flags, reference, *words)
    try:
        yield container
    finally:
        docker("rm", "--force", "--volumes", container)


def await_health(container: str, patience: float = 600.0) -> str:
    """The health when it is decided, or ``exited`` with what the container said."""
    end = time.monotonic() + patience
    while time.monotonic() < end:
        state = json.loads(docker("inspect", "--format", "{{json .State}}", container))
        if not state["Running"]:
            return "exited: " + docker("logs", container)
        if state["Health"]["Status"] != "starting":
            return str(state["Health"]["Status"])
        time.sleep(0.2)
    return "starting"


def test_there_is_an_image_for_each_service(built: dict[str, str]) -> None:
    assert set(built) == {"base", "geometry", "vision", "sandbox", "ros-bridge", *(m.image for m in MANIFESTS.values())}


def test_labels_and_users(built: dict[str, str]) -> None:
    """Shared stages do not pass for services."""
    for image, reference in built.items():
        about = config(reference)
        assert about["User"] == "10001:10001"
        assert about["Labels"] == {
            "org.opencontainers.image.title": image,
            "org.opencontainers.image.version": __version__,
            "org.opencontainers.image.source": SOURCE,
            **({} if image in SHARED else {"dodo.service": image}),
        }


INSIDE = """
import importlib, json, pathlib, pkgutil, sys
package = importlib.import_module(sys.argv[1])
names = [m.name for m in pkgutil.iter_modules(package.__path__, sys.argv[1] + ".")]
for name in names:
    if not name.endswith(".__main__"):
        importlib.import_module(name)
files = [str(path) for folder in ("dodo_dsl", "services") for path in pathlib.Path("/opt/dodo", folder).rglob("*")]
held = [path.name for path in pathlib.Path("services").iterdir()]
print(json.dumps({"modules": len(names), "held": held, "files": files}))
"""


def holds_its_own_service(told: str, folders: set[str]) -> None:
    """Its modules and no others, all that they import (also where a flag asks for it), and the bytecode of each."""
    found = json.loads(told)
    assert found["modules"] >= 2
    assert set(found["held"]) == {"__init__.py", "__pycache__", "base", *folders}
    sources = [Path(file) for file in found["files"] if file.endswith(".py")]
    compiled = {str(file).partition(".cpython-")[0] for file in found["files"] if file.endswith(".pyc")}
    assert len(sources) > 20
    assert [s for s in sources if f"{s.parent}/__pycache__/{s.stem}" not in compiled] == []


@pytest.fixture(scope="module")
def tried(built: dict[str, str]) -> Iterator[dict[str, Future[None]]]:
    """What becomes of each service by name, three at a time, as one alone mostly waits for the engine."""
    with ThreadPoolExecutor(3) as pool:
        yield {m.name: pool.submit(starts_with_all_it_needs, built[m.image], m) for m in MANIFESTS.values()}


def starts_with_all_it_needs(image: str, manifest: Manifest) -> None:
    inside = ("python3", "-c", INSIDE, f"services.{manifest.folder.name}")
    holds_its_own_service(run(image, *inside), folders_of(manifest.image))
    about = yaml.safe_load((manifest.folder / "service.yml").read_text())
    if "example" not in about or manifest.devices == ("{serial}",):  # which needs a rig, or the clock of a test
        out = docker("run", "--rm", "--network", "none", *HARDENED, image, "--help")
        assert manifest.description in " ".join(out.split())
        return
    files = ("--volume", f"{ROOT / 'tests_registry'}:/opt/dodo/tests_registry:ro")
    words = (manifest.name, "--cid=131", *about["example"])
    with own_volume() as volume, started(image, volume, *words, flags=files) as container:
        found = await_health(container)  # a short drive may be over before the engine has looked
        assert found == "healthy" or found.startswith('exited: {"dodo": "ready"}'), found


@each_service
def test_service_starts_from_an_image_that_holds_all_it_needs(
    tried: dict[str, Future[None]], manifest: Manifest
) -> None:
    """It gets healthy with its example, so the libraries are there that it loads late, such as the video decoder."""
    tried[manifest.name].result()


def test_the_gantry_s_image_has_an_emulated_rig_that_runs(built: dict[str, str]) -> None:
    if not (ROOT / "build" / "firmware" / "rig-emulator").exists():
        pytest.skip("the emulated rig is not built: make firmware")
    look = "cd /opt/dodo/firmware && test -r gantry.elf -a -r gantry-circle.elf && ./rig-emulator --help"
    assert run(built["gantry"], "sh", "-c", look).startswith("usage: rig-emulator ")


@pytest.mark.parametrize("name", [pytest.param("sandbox", marks=pytest.mark.proof), "virtual-camera"])
def test_nothing_is_writable_that_need_not_be(built: dict[str, str], name: str) -> None:
    """Looked at as root, who sees every folder; ``/dev`` and ``/proc`` are the engine's."""
    as_root = ("--user", "0")
    find = ("find", "/", "-xdev")
    world = run(built[name], *find, "-perm", "-0002", "!", "-type", "l", flags=as_root).splitlines()
    assert set(world) <= {"/tmp", "/var/tmp", "/run/lock"}
    assert run(built[name], "stat", "--format", "%a %u", "/tmp", flags=as_root) == "1777 0"
    assert run(built[name], *find, "-user", "10001", flags=as_root).splitlines() == ["/dodo/report"]
    assert run(built[name], *find, "-nouser", flags=as_root) == ""


def test_service_gets_healthy_and_ends_when_told_to(built: dict[str, str], volume: str) -> None:
    with started(built["integrator"], volume, "pose", "--cid=131") as container:
        assert await_health(container) == "healthy"
        assert docker("logs", container).splitlines()[0] == '{"dodo": "ready"}'
        docker("stop", "--time", "10", container)
        assert docker("inspect", "--format", "{{.State.ExitCode}}", container) == "0"


def test_recorder_writes_into_a_volume_that_docker_makes(built: dict[str, str], volume: str) -> None:
    words = ("rec-recorder", "--rec=/dodo/report/test.rec", "--cid=132")
    with started(built["rec-recorder"], volume, *words, flags=("--volume", "/dodo/report")) as container:
        assert await_health(container) == "healthy"
        assert docker("exec", container, "stat", "--format", "%u", "/dodo/report/test.rec") == "10001"


def test_camera_shares_memory_with_another_user(built: dict[str, str], volume: str) -> None:
    """An application may well run as root without capabilities to read what is not its own."""
    maps = ROOT / "tests_registry" / "maps"
    flags = ("--ipc", "shareable", "--volume", f"{maps}:/dodo/files/maps:ro")
    words = ("camera", "--map-path=/dodo/files/maps/straight", "--cid=133")
    with started(built["virtual-camera"], volume, *words, flags=flags) as container:
        assert await_health(container) == "healthy"
        look = "from dodo_dsl.opendlv.shared_memory import SharedMemory as S; print(S.attach('video0.argb').size)"
        application = ("--user", "0", "--ipc", f"container:{container}", "--volume", f"{volume}:/tmp")
        assert run(built["vision"], "python3", "-c", look, flags=(*HARDENED, *application)) == str(640 * 480 * 4)


def test_layers_are_shared(built: dict[str, str]) -> None:
    """A service is some small layers on those of its stage, and the stages stand on each other but for the sources."""
    words = ("image", "inspect", "--format", "{{.Size}} {{json .RootFS.Layers}}")
    rows = [row.split(" ", 1) for row in docker(*words, *built.values()).splitlines()]
    found = {name: (int(size), json.loads(layers)) for name, (size, layers) in zip(built, rows, strict=True)}
    base, geometry, vision = (found[name][1] for name in ("base", "geometry", "vision"))
    assert geometry[: len(base) - 1] == base[:-1] and vision[: len(geometry) - 1] == geometry[:-1]
    assert found["ros-bridge"][1][: len(geometry) - 1] == geometry[:-1], "its own stage is above vision's libraries"
    for name in {*built} - {"base", "geometry", "vision", "ros-bridge"}:
        stage, (size, layers) = targets()[name]["args"]["STAGE"], found[name]
        if stage == "pictures":  # a stage that is no image
            assert (
                layers[: len(geometry) - 1] == geometry[:-1] and layers[len(geometry) - 1] == vision[len(geometry) - 1]
            )
            continue
        size_below, below = found["base" if stage == "rig" else stage]
        assert layers[: len(below)] == below, name
        assert len(layers) - len(below) <= MOST_LAYERS and size - size_below <= MOST_BYTES, name


def test_the_example_application_is_built_and_starts(
    built: dict[str, str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = shutil.copytree(ROOT / "examples" / "kiwi", tmp_path / "kiwi")
    compose = yaml.safe_load((folder / "docker-compose.yml").read_text())
    for name, service in compose["services"].items():
        service["image"] = f"dodo-test/kiwi-{name}:images"
    (folder / "docker-compose.yml").write_text(yaml.safe_dump(compose))
    monkeypatch.setenv("DODO_BASE", built["vision"])
    docker("compose", "--project-directory", str(folder), "-f", str(folder / "docker-compose.yml"), "build")
    references = [service["image"] for service in compose["services"].values()]
    try:
        for reference in references:
            assert config(reference)["User"] == "10001:10001"
            assert "--cid" in docker("run", "--rm", "--network", "none", *HARDENED, reference, "--help")
    finally:
        docker("image", "rm", "--force", *references)
