"""An application's containers beside DoDo's services as processes.

Both share a network, an IPC namespace and ``/tmp``. A container holds these: it runs a program of this machine, and no
image.
"""

import os
import secrets
import shutil
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import yaml

from dodo_dsl.application.interpolation import escaped
from dodo_dsl.application.model import FILES, SANDBOX
from dodo_dsl.plan.added_services import TIME
from dodo_dsl.plan.model import LAYERS, Plan
from dodo_dsl.run import application_time
from dodo_dsl.run.docker.container_use import ELSEWHERE, first_process
from dodo_dsl.run.docker.mounts import over
from dodo_dsl.run.docker.shared_files import IMAGE
from dodo_dsl.run.process import namespaces
from dodo_dsl.run.process.slot import Entered
from dodo_dsl.run.protocol import BackendError
from dodo_dsl.spec.model import VIRTUAL

_SEEN = ("/bin", "/lib", "/lib64", "/usr")
"""Folders of this machine that hold the program and its libraries."""
_TMP = "tmp"


def with_holder(made: dict[str, Any], plan: Plan, folder: Path, needed: Iterable[Path]) -> dict[str, Any]:
    """The application's compose file with the containers that DoDo adds; nothing waits for DoDo's services.

    Those have programs of this machine. ``folder`` is the compiled test's, ``needed`` is what DoDo's processes find in
    ``/tmp``. Mounts lie over the folders in ``/tmp`` where these have theirs: so no container removes them.
    """
    compiled = yaml.load((folder / f"{LAYERS[0]}.compose.yml").read_bytes(), yaml.CSafeLoader)
    services, own = dict(made["services"]), dict[str, Any]()
    if (files := services.pop(FILES, None)) is not None:
        copies = compiled["services"][FILES]
        shell, *words = copies["entrypoint"]
        copies = {**copies, "volumes": over(copies["volumes"], files.get("volumes", ()))}
        own[FILES] = _on_machine(copies, _program(shell), *words)
    volumes, shown = dict(made.get("volumes") or {}), tuple[Path, ...]()
    if plan.isolation == "network":
        shown = Entered.with_own(0, *needed).shown
        waits = compiled["services"][SANDBOX]["command"] if plan.clock == VIRTUAL else [_program("sleep"), "infinity"]
        own[SANDBOX] = {**_on_machine(compiled["services"][SANDBOX], *waits), "user": "65534:65534"}
        volumes[_TMP] = compiled["volumes"][_TMP]
        if plan.clock == VIRTUAL:  # with what this machine has built, the holder lets the application's time go on
            place = escaped(str(application_time.built().library.parent))
            volumes[TIME] = {"driver_opts": {"type": "none", "o": "bind", "device": place}}
    mounts = covers(shown)
    for service in services.values():
        after = service.get("depends_on") or {}
        service["depends_on"] = {name: how for name, how in after.items() if name in services or name in own}
        service["volumes"] = over(mounts, service.get("volumes", ()))
    networks = {"networks": compiled["networks"]} if "networks" in compiled else {}
    return {**made, **networks, "services": {**services, **own}, "volumes": volumes}


def _on_machine(compiled: dict[str, Any], *words: str) -> dict[str, Any]:
    """A container as it is ``compiled``, which does what the ``words`` say with this machine's programs."""
    kept = {key: value for key, value in compiled.items() if key not in ("command", "depends_on")}
    seen = [folder for folder in _SEEN if Path(folder).is_dir()]
    folders = [{"type": "bind", "source": folder, "target": folder, "read_only": True} for folder in seen]
    return {**kept, "image": IMAGE, "entrypoint": [*words], "volumes": [*compiled["volumes"], *folders]}


def _program(name: str) -> str:
    return shutil.which(name, path=os.defpath) or f"/bin/{name}"


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
