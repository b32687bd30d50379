"""One finding about this machine."""

from dataclasses import dataclass
from typing import Literal

State = Literal["ok", "warning", "problem"]


@dataclass(frozen=True)
class Capability:
    """One thing that was examined; ``advice`` is what to do when it is not ok."""

    name: str
    state: State
    text: str
    advice: str = ""
