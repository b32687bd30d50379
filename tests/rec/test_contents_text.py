"""Contents of a recording for people."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

from dodo_dsl.opendlv.recording import Damage
from dodo_dsl.rec.contents import Contents, Frames, MessageStream, contents_text

STREAMS = [MessageStream(19, "opendlv.Name", 0, 3, 30, 2.0, 0.75), MessageStream(8000, None, 12, 1, 10, None, None)]
FOUND = Contents(900, 4, 1_700_000_000.5, 1.5, 0, 0, 0, "1.0", STREAMS, Frames(0, None))


def text(found: Contents, *damage: tuple[int, int, str]) -> list[str]:
    recording: Any = SimpleNamespace(path="a.rec", damage=Damage())
    for place in damage:
        recording.damage.add(*place)
    return contents_text(found, recording).splitlines()


def test_facts_and_a_table() -> None:
    assert text(FOUND) == [
        "a.rec: 4 messages in 1.5 s, 900 bytes",
        "begins 2023-11-14 22:13:20 UTC",
        "message set 1.0",
        "",
        "  id  message       sender  count     rate  largest gap",
        "  19  opendlv.Name       0      3  2.00 Hz      0.750 s",
        "8000  (unknown)         12      1",
    ]


def test_what_is_odd_is_said() -> None:
    odd = replace(FOUND, begin=None, unordered=2, untimed=1, apart=1, frames=Frames(5, 4))
    lines = text(odd, *[(10 * place, 1, "no frame begins here") for place in range(12)])
    assert lines[1] == "1 message is more than a day away from these and not counted"
    assert "camera frames: 5 packets, 4 decoded" in lines
    assert "2 steps back in time, 1 messages without a sample time" in lines
    assert sum(line.startswith("skipped 1 byte at byte ") for line in lines) == 10
    assert "skipped 12 bytes at 12 positions in all" in lines
    assert "camera frames: 5 packets, not decoded" in text(replace(odd, frames=Frames(5, None)))
