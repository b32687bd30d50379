"""Where the Python of services and sandboxes finds them."""

import os
from pathlib import Path

from dodo_dsl import package_data


def package_path() -> str:
    """``PYTHONPATH`` of services and sandbox: the folders of ``services`` and of ``dodo_dsl``."""
    places = [str(package_data.root()), str(Path(__file__).resolve().parents[3]), os.environ.get("PYTHONPATH", "")]
    return os.pathsep.join(dict.fromkeys(p for p in places if p))
