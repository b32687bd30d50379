"""What to type or install where something is missing, as messages say it."""

import importlib
import os
import sys

_LOADED = {
    "mcap": ("mcap.writer", "mcap_protobuf.schema", "foxglove_schemas_protobuf"),
    "ros": ("rosbags.rosbag2", "cyclonedds.core"),
    "search": ("optuna", "scipy"),
    "storage": ("psycopg",),
}
"""Modules of what each extra of DoDo installs, which load what they need themselves."""
DOCKER = "install Docker Engine with the plugins compose and buildx (https://docs.docker.com/engine/install)"
FIRMWARE = "'make firmware' in a checkout of DoDo, then export DODO_FIRMWARE=CHECKOUT/build/firmware"


def missing(extra: str) -> str:
    """The first module that this Python lacks for an extra; empty if it has all."""
    for module in _LOADED[extra]:
        try:
            importlib.import_module(module)
        except ImportError as error:  # psycopg's has no name where it finds no library of PostgreSQL
            return (error.name or module).partition(".")[0]
    return ""


def install(extra: str) -> str:
    return f"{sys.executable} -m pip install 'dodo-dsl[{extra}]'"


def engine() -> str:
    if host := os.environ.get("DOCKER_HOST"):
        return f"DOCKER_HOST is {host}: start the engine there, in a job of GitLab as its service, or unset DOCKER_HOST"
    joining = "join its group (usermod -aG docker $USER, then log in again)"
    return f"start it (systemctl start docker), {joining}, or {DOCKER}"
