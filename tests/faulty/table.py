"""The faults of ``faults.yml``: what the tests have to find."""

from dataclasses import dataclass
from pathlib import Path

import yaml

TABLE = Path(__file__).with_name("faults.yml")


@dataclass(frozen=True)
class Fault:
    """A faulty application, and the shipped ``test`` that has to fail with ``words``, a regular expression.

    ``kind`` is what the fault spoils, ``does`` a sentence. ``due`` is what is missing in DoDo where nothing catches it.
    """

    name: str
    kind: str
    does: str
    test: str
    words: str
    due: str = ""


FAULTS = {name: Fault(name, **about) for name, about in yaml.safe_load(TABLE.read_text(encoding="utf-8")).items()}
