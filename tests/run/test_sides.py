"""A test of two sides: which of them does what, and what both know together."""

from collections.abc import Collection
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from dodo_dsl.run.machine_load.service_use import Snapshot, Used
from dodo_dsl.run.sides import Send, Sides, WatchedServices
from tests.run.scripted import plan, run


@dataclass
class Scripted:
    """A side that has used something, and writes what it does into ``calls``."""

    name: str
    used: Snapshot | None
    calls: list[str] = field(default_factory=list)

    async def open(self, entered: int = 0) -> int:
        self.calls.append(f"{self.name} open {entered}")
        return 17

    async def start(self, layer: str) -> dict[str, bool]:
        self.calls.append(f"{self.name} {layer}")
        return {}

    async def connect(self) -> Send:
        return lambda data, to=(): self.calls.append(f"{self.name} send {len(to)}")

    async def beginning(self) -> Collection[int]:
        return ()

    async def listeners(self) -> Collection[str] | None:
        return None

    async def application(self) -> Collection[int] | None:
        return None

    async def use(self) -> Snapshot | None:
        return self.used

    async def close(self, keep: bool) -> list[str]:
        return [self.name] if keep else []


OWN, APP = Snapshot(1.0, {"camera": Used(1.0)}, 2, 3.0), Snapshot(1.5, {"app": Used(2.0)}, 2, 3.5)
UNSEEN = Snapshot(1.5, {"app": Used(2.0)}, 2)


@pytest.mark.parametrize(
    ("own", "application", "both"),
    [
        (OWN, APP, Snapshot(1.0, {**OWN.services, **APP.services}, 2, 3.0)),
        (OWN, UNSEEN, Snapshot(1.0, {**OWN.services, **APP.services}, 2)),
        (None, APP, UNSEEN),
        (OWN, None, None),
    ],
)
def test_two_sides_are_one_backend(
    own: Snapshot | None, application: Snapshot | None, both: Snapshot | None, tmp_path: Path
) -> None:
    first = Scripted("own", own)
    second = Scripted("application", application, first.calls)

    async def drive(sides: Sides) -> list[str]:
        await sides.open()
        for layer in ("environment", "application"):
            await sides.start(layer)
        await sides.begin()
        assert await sides.use() == both
        return await sides.close(keep=True)

    watched = WatchedServices(plan(), tmp_path, tmp_path)
    assert run(drive(Sides("mixed", 130, False, watched, first, second))) == ["own", "application"]
    does = ["application open 0", "own open 17", "own environment", "application application", "own send 2"]
    assert first.calls == does
