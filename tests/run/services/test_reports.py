"""What services say over the channel reaches the runner, however they connect and end."""

import asyncio
import socket
from contextlib import closing
from dataclasses import replace
from pathlib import Path

from dodo_dsl.opendlv.packets import RUNNER_SOCKET, Connection
from dodo_dsl.run.protocol import Event, Noted, VerdictEvent
from dodo_dsl.run.service_protocol import Reports
from tests.run.scripted import plan

NOTE = b'{"dodo": "note", "text": "so"}'
VERDICT = b'{"dodo": "verdict", "outcome": "passed", "reason": "so", "checks": []}'


def test_what_was_said_counts_and_nobody_waits(tmp_path: Path) -> None:
    """Of those, too, who end at once, whose name comes late, or whose message comes in parts."""
    one, events, path = plan(), list[Event](), tmp_path / RUNNER_SOCKET
    (judge, *_) = (service for service in one.services if service.judge)
    brief = [replace(judge, name=f"brief{n}", judge=False) for n in range(4)]

    async def scene() -> None:
        reports = Reports(replace(one, services=(judge, *brief)), tmp_path, events.append, {})
        reports.listen(tmp_path)
        for service in brief:
            with closing(Connection.open(path, service.name)) as connection:
                connection.send(NOTE)
        await reports.ended(brief[-1].name)
        assert events == [Noted(f"service '{service.name}': so") for service in brief]
        with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as late:
            late.connect(str(path))
            await asyncio.sleep(0.01)
            for packet in (b"\0" + judge.name.encode(), b"\1" + VERDICT[:9], b"\0" + VERDICT[9:]):
                late.send(packet)
                await asyncio.sleep(0.01)
            assert not reports.take_line(judge.name, VERDICT), "it has connected"
        await reports.ended(judge.name)
        assert events[4:] == [VerdictEvent(judge.name, True, "so", ())] and not path.exists()
        reports.close()

    asyncio.run(scene())
