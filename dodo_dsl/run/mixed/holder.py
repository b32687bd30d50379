"""The container that holds a test's network, IPC namespace and ``/tmp``: a program of this machine, and no image."""

import os
import shutil
from pathlib import Path
from typing import Any

from dodo_dsl.run.docker.shared_files import IMAGE

_PROGRAM = "sleep"
_SEEN = ("/bin", "/lib", "/lib64", "/usr")
"""Folders of this machine that hold the program and its libraries."""


def holder(slug: str) -> dict[str, Any]:
    """The container in compose's words; it can do nothing but sleep."""
    return {
        "image": IMAGE,
        "entrypoint": [shutil.which(_PROGRAM, path=os.defpath) or f"/bin/{_PROGRAM}", "infinity"],
        "user": "65534:65534",
        "init": True,
        "ipc": "shareable",
        "shm_size": "256m",
        "read_only": True,
        "cap_drop": ["ALL"],
        "security_opt": ["no-new-privileges:true"],
        "labels": {"dodo.test": slug, "dodo.layer": "sandbox"},
        "volumes": ["tmp:/tmp", *_folders()],
    }


def copier(compiled: dict[str, Any]) -> dict[str, Any]:
    """The container that copies the repository's files, as it is ``compiled``, with this machine's programs."""
    kept = {key: value for key, value in compiled.items() if key not in ("image", "entrypoint", "depends_on")}
    shell, *words = compiled["entrypoint"]
    folders = [*compiled["volumes"], *_folders()]
    return {**kept, "image": IMAGE, "entrypoint": [shutil.which(shell) or shell, *words], "volumes": folders}


def _folders() -> list[dict[str, Any]]:
    """The mounts of this machine's programs."""
    seen = [folder for folder in _SEEN if Path(folder).is_dir()]
    return [{"type": "bind", "source": folder, "target": folder, "read_only": True} for folder in seen]
