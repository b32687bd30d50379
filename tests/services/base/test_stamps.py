from hypothesis import given
from hypothesis import strategies as st

from dodo_dsl.opendlv.envelope import Envelope
from services.base.loop import HeardStamps, with_strangers

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
