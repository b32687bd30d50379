"""Where the Python of services and sandboxes finds them."""

import os
from collections.abc import Iterable
from pathlib import Path

from dodo_dsl import package_data


def package_path(own: Iterable[Path] = ()) -> str:
    """``PYTHONPATH`` of services and sandbox: the folders of ``services`` and of ``dodo_dsl``, and ``own`` ones."""
    ours = (package_data.root(), Path(__file__).resolve().parents[3])
    places = [*map(str, (*ours, *own)), os.environ.get("PYTHONPATH", "")]
    return os.pathsep.join(dict.fromkeys(p for p in places if p))
