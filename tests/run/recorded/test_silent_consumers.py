"""Which program of an application got messages and sent nothing."""

from pathlib import Path

import pytest

from dodo_dsl.opendlv.message_set import MessageSet
from dodo_dsl.plan.model import Application, ApplicationService
from dodo_dsl.run.test_recording import silent_consumer
from tests.run.recorded.made import begin, message, write
from tests.run.scripted import plan

STATUS, STEERING = "opendlv.system.SystemStatusMessage", "opendlv.proxy.GroundSteeringRequest"
TOLD = f"{STATUS} came from 'lane', but 'driver', which consumes it, sent nothing"


@pytest.mark.parametrize(
    ("consumed", "came", "told"),
    [
        (STATUS, [STATUS], TOLD),
        (f"{STATUS}/0", [STATUS], TOLD.replace(STATUS, f"{STATUS}/0")),
        (f"{STATUS}/2", [STATUS], ""),
        (STATUS, [], ""),
        (STATUS, [STATUS, STEERING], ""),
        (STEERING, [STEERING], ""),
        ("team.Unknown", [STATUS], ""),
    ],
)
def test_the_consumer_of_what_came(tmp_path: Path, consumed: str, came: list[str], told: str) -> None:
    services = (
        ApplicationService("lane", outputs=(STATUS, "team.Unknown")),
        ApplicationService("driver", inputs=(consumed,), outputs=(STEERING,)),
    )
    rec = write(tmp_path / "test.rec", begin(), *(message(name, 1, 1) for name in came))
    assert set(came) <= set(MessageSet.standard().names())
    assert silent_consumer(plan(application=Application(".", services)), tmp_path, rec) == told
