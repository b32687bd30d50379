"""What a sandbox enters instead of namespaces of its own: those of a container, which the application shares."""

import json
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Self

_FLAG = "--enter="


@dataclass(frozen=True)
class Entered:
    """A process of the container on this machine, and folders of the host that services need, also below ``/tmp``."""

    process: int
    shown: tuple[Path, ...] = ()

    @classmethod
    def with_own(cls, process: int, *folders: Path) -> Self:
        """With the folders of Python and of DoDo as this process has them."""
        own = (Path(sys.prefix), Path(sys.base_prefix), *(Path(place) for place in sys.path if place))
        return cls(process, tuple(dict.fromkeys(path.resolve() for path in (*folders, *own))))

    def word(self) -> str:
        """The word of a sandbox's command line."""
        return _FLAG + json.dumps([self.process, *map(str, self.shown)])

    @classmethod
    def among(cls, words: Sequence[str]) -> Self | None:
        """The one among the words of a sandbox's command line."""
        for word in words:
            if word.startswith(_FLAG):
                process, *shown = json.loads(word.removeprefix(_FLAG))
                return cls(process, tuple(map(Path, shown)))
        return None
