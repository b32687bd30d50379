"""An application's containers beside DoDo's services as processes.

Both share a network, an IPC namespace and ``/tmp``. A container holds these: it runs a program of this machine, and no
image.
"""

import io
import secrets
import tarfile
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from docker.errors import DockerException, ImageNotFound

from dodo_dsl.application.interpolation import escaped
from dodo_dsl.application.model import FILES, SANDBOX
from dodo_dsl.plan.added_services import TIME
from dodo_dsl.plan.model import Plan
from dodo_dsl.run import application_time
from dodo_dsl.run.docker.client import engine_error
from dodo_dsl.run.docker.container_use import ELSEWHERE, first_process
from dodo_dsl.run.docker.mounts import over
from dodo_dsl.run.process import namespaces
from dodo_dsl.run.process.slot import Entered
from dodo_dsl.run.protocol import BackendError

IMAGE = "dodo-empty:1"
"""Made on the engine where it is missing; it has no files."""
_SEEN = ("/bin", "/lib", "/lib64", "/usr")
"""Folders of this machine that hold the program and its libraries."""
_TMP = "tmp"
_NOBODY = "containers-of-dodo"
"""A profile that compose is not asked for."""


def provide_image(client: Any) -> None:
    """Makes the empty image, unless the engine has it; raises BackendError."""
    try:
        try:
            client.api.inspect_image(IMAGE)
        except ImageNotFound:
            empty = io.BytesIO()
            tarfile.open(fileobj=empty, mode="w").close()
            repository, tag = IMAGE.split(":")
            client.api.import_image_from_data(empty.getvalue(), repository=repository, tag=tag)
    except (DockerException, OSError) as error:
        raise BackendError(f"the Docker engine cannot make an empty image: {engine_error(error)}") from error


def without_own(made: dict[str, Any], plan: Plan, needed: Iterable[Path]) -> dict[str, Any]:
    """The compose file over the compiled ones with no container of DoDo's services, for which nothing waits.

    Containers that DoDo adds have programs of this machine. ``needed`` is what DoDo's processes find in ``/tmp``.
    Mounts lie over the folders in ``/tmp`` where these have theirs: so no container removes them.
    """
    machine = [
        {"type": "bind", "source": folder, "target": folder, "read_only": True} for folder in _SEEN
        if Path(folder).is_dir()
    ]  # fmt: skip
    services: dict[str, Any] = {service.name: {"profiles": [_NOBODY]} for service in plan.services}
    volumes, shown = dict(made.get("volumes") or {}), tuple[Path, ...]()
    if plan.isolation == "network":
        shown = Entered.with_own(0, *needed).shown
        services[SANDBOX] = {"image": IMAGE, "user": "65534:65534", "volumes": machine}
        if plan.lockstep:  # with what this machine has built, the holder lets the application's time go on
            place = escaped(str(application_time.built().library.parent))
            volumes[TIME] = {"driver_opts": {"type": "none", "o": "bind", "device": place}}
    mounts = covers(shown)
    for name, service in made["services"].items():
        own = service.get("volumes", ())
        if name == FILES:
            services[name] = {"image": IMAGE, "volumes": [*machine, *own]}
        else:
            kept = {key: value for key, value in service.items() if key != "depends_on"}
            services[name] = {**kept, "volumes": over(mounts, own)}
    return {**made, "services": services, "volumes": volumes}


def covers(shown: Iterable[Path]) -> list[dict[str, Any]]:
    """Empty folders over those that processes of DoDo mount in the test's ``/tmp`` and shared memory, as mounts.

    The kernel removes and renames no folder on which something is mounted in the namespace of the caller, at any
    path. So each service of the application needs them, as one without ``/tmp`` may reach another's; at a path that no
    image knows, so that no symbolic link of an image leads them elsewhere.
    """
    apart = Path(f"/.dodo-{secrets.token_hex(8)}")
    tmp, memory = namespaces.SHARED
    folders = [path for path in shown if path.is_dir() and not path.is_symlink()]  # as only these are mounted
    places = [{tmp: apart, memory: memory}[path.parent] / path.name for path in folders]
    mounts: list[dict[str, Any]] = [
        {"type": "tmpfs", "target": escaped(str(place)), "read_only": True} for place in places
    ]
    if apart in {place.parent for place in places}:
        options = {"read_only": True, "volume": {"nocopy": True}}
        mounts.insert(0, {"type": "volume", "source": _TMP, "target": str(apart), **options})
    return mounts


_OWN_MEMORY = "a folder below /dev/shm: remove that mount, or keep the repository and what the test needs elsewhere"


def entered(containers: Mapping[str, Any], application: Iterable[str]) -> int:
    """The process whose namespaces DoDo's processes enter, 0 on the host's network; raises BackendError."""
    for service in application:
        if service in containers and (name := uncovered(containers[service].attrs)):
            raise BackendError(f"service '{service}' mounts {name} itself, and the test needs {_OWN_MEMORY}")
    if SANDBOX not in containers:
        return 0
    process = first_process(containers[SANDBOX])
    if process is None:
        raise BackendError(f"{ELSEWHERE}, whose network DoDo's processes cannot enter; use --backend docker")
    if not process:
        state = containers[SANDBOX].attrs["State"]
        why = state.get("Error") or f"exit code {state.get('ExitCode')}"
        raise BackendError(f"the container that holds the test's network ended at once: {why}")
    return process


def uncovered(attributes: Mapping[str, Any]) -> str:
    """What a container mounts in the place of shared memory, so that covers are none there; empty if they are."""
    folders = {mount["Destination"] for mount in attributes.get("Mounts") or ()}
    folders |= set(attributes["HostConfig"].get("Tmpfs") or ())
    memory = namespaces.SHARED[1]
    own = [str(folder) for folder in (memory.parent, memory) if str(folder) in folders]
    return own[0] if own and any(Path(folder).parent == memory for folder in folders) else ""
