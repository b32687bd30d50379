"""The stages of a Dockerfile, as far as the tests need them."""

import json
import re
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]


@dataclass(frozen=True)
class Stage:
    """A stage: what it stands on, and its instructions."""

    stands_on: str
    text: str

    @property
    def entrypoint(self) -> list[str]:
        match = re.search(r"^ENTRYPOINT (\[.*\])$", self.text, re.MULTILINE)
        return list(json.loads(match[1])) if match else []

    @property
    def labels(self) -> dict[str, str]:
        return dict(re.findall(r'([a-z][a-z.]+)="([^"]*)"', self.text))

    @property
    def copies(self) -> list[tuple[str, str]]:
        return re.findall(r"^COPY --from=code (\S+) (\S+)$", self.text, re.MULTILINE)


def stages(path: Path = ROOT / "services" / "Dockerfile") -> dict[str, Stage]:
    """Stages by name."""
    _, *parts = re.split(r"^FROM ", path.read_text(), flags=re.MULTILINE)
    found = {}
    for part in parts:
        head, _, text = part.partition("\n")
        below, name = head.split(" AS ")
        found[name] = Stage(below, text)
    return found
