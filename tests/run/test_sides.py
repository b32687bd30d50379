"""A test of two sides: which of them does what, and what both know together."""

from pathlib import Path
from unittest import mock

import pytest

from dodo_dsl.run.machine_load.service_use import Snapshot, Used
from dodo_dsl.run.sides import Backend, WatchedServices
from tests.run.scripted import plan, run

OWN, APP = Snapshot(1.0, {"camera": Used(1.0)}, 2, 3.0), Snapshot(1.5, {"app": Used(2.0)}, 2, 3.5)
UNSEEN = Snapshot(1.5, {"app": Used(2.0)}, 2)
BOTH = Snapshot(1.0, {**OWN.services, **APP.services}, 2)


@pytest.mark.parametrize(
    ("own", "application", "both"),
    [
        (OWN, APP, Snapshot(1.0, BOTH.services, 2, 3.0)),
        (OWN, UNSEEN, BOTH),
        (None, APP, UNSEEN),
        (OWN, None, None),
    ],
)
def test_two_sides_are_one_backend(
    own: Snapshot | None, application: Snapshot | None, both: Snapshot | None, tmp_path: Path
) -> None:
    first, second, send = mock.AsyncMock(), mock.AsyncMock(), mock.Mock()
    first.connect.return_value, first.use.return_value, first.close.return_value = send, own, ["own"]
    second.open.return_value, second.use.return_value, second.close.return_value = 17, application, ["application"]
    second.beginning.return_value = ()

    async def drive(sides: Backend) -> list[str]:
        await sides.open()
        for layer in ("environment", "application"):
            await sides.start(layer)
        await sides.begin()
        assert await sides.use() == both
        return await sides.close(keep=True)

    watched = WatchedServices(plan(), tmp_path, tmp_path)
    assert run(drive(Backend("mixed", 130, False, watched, first, second))) == ["own", "application"]
    first.open.assert_awaited_once_with(17)
    first.start.assert_awaited_once_with("environment")
    second.start.assert_awaited_once_with("application")
    send.assert_called_once_with(mock.ANY, ["camera", "track"])
