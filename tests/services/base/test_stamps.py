import pytest
from hypothesis import given
from hypothesis import strategies as st

from dodo_dsl.opendlv.envelope import Envelope
from dodo_dsl.opendlv.session import Session
from services.base.clock import RealTimeClock
from services.base.loop import HeardStamps, Loop, with_strangers
from services.base.service import Service

STEER, PEDAL = 1090, 1086
INPUTS = {(STEER, 0): "opendlv.proxy.GroundSteeringRequest", (STEER, 9): "opendlv.proxy.GroundSteeringRequest"}
stamps = st.lists(st.sampled_from([0, 1, 9, 99]), max_size=12)


def heard(*those: tuple[int, int]) -> HeardStamps:
    counts = HeardStamps({**INPUTS, (PEDAL, None): "opendlv.proxy.PedalPositionRequest"})
    for kind, stamp in those:
        counts.take(Envelope(kind, b"", 0, 0, 0, stamp))
    return counts


def test_what_came_under_another_stamp_is_named() -> None:
    assert heard(*[(STEER, 99)] * 120, (STEER, 9), (STEER, 3), (PEDAL, 5)).strangers() == [
        "no opendlv.proxy.GroundSteeringRequest/0 came, but 1 with sender stamp 3 and 120 with sender stamp 99"
    ]


@given(stamps)
def test_only_a_stamp_that_never_came_is_told_and_only_beside_strangers(those: list[int]) -> None:
    told = heard(*((STEER, stamp) for stamp in those)).strangers()
    unheard = [stamp for stamp in (0, 9) if stamp not in those]
    has_strangers = any(stamp not in (0, 9) for stamp in those)
    assert [int(text.split("/")[1].split()[0]) for text in told] == (unheard if has_strangers else [])


def test_the_reason_goes_on_with_them() -> None:
    assert with_strangers("no sample came", ["no X/0 came, but 1 with sender stamp 2"]) == (
        "no sample came; no X/0 came, but 1 with sender stamp 2"
    )
    assert with_strangers("no sample came", []) == "no sample came"


class Losing(Session):
    """A session that loses messages as the last ones are read."""

    def receive(self, timeout: float | None = 0.0) -> Envelope | None:
        self.lost += 7
        return None


def test_losses_and_pauses_are_told_to_the_last_one(cid: int, capsys: pytest.CaptureFixture[str]) -> None:
    service = Service()
    service.paused = 0.0625
    service.observe = lambda _: None
    with Losing(cid) as session:
        Loop("recorder", service, session, RealTimeClock(), 0).run(lambda: True)
        lost = f'{{"dodo": "lost", "messages": {session.lost}}}'
    assert capsys.readouterr().out.splitlines() == [lost, '{"dodo": "paused", "seconds": 0.062}']
