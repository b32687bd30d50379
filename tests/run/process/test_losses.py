"""Messages that a service loses to a full receive buffer are told, to the last one."""

from dataclasses import replace
from pathlib import Path

import pytest

from dodo_dsl import package_data
from dodo_dsl.opendlv.recording import read_envelopes
from dodo_dsl.plan.model import Flag, Plan, PlannedService
from tests.run.helpers import READY, Bench

CROWD, LAST, RECORDING_END = 400, 4711, 2906
SLOW_RECORDER = f"""
import pathlib, sys, time
from dodo_dsl.opendlv import session
session.RECEIVE_BUFFER = 8192
from services.base import run
from services.rec_recorder import model, service
write = model.RecordingFile.write
model.RecordingFile.write = lambda self, envelope: (time.sleep(0.002), write(self, envelope))
sys.exit(run(pathlib.Path({str(package_data.root())!r}, "services", "rec_recorder"), service.build))
"""
CROWDING_JUDGE = f"""
import pathlib, sys, time
from dodo_dsl.opendlv.envelope import Envelope
from dodo_dsl.opendlv.session import Session
with Session(int(sys.argv[1].partition("=")[2])) as bus:
    {READY.strip()}
    while bus.receive(1.0) is None:
        pass
    for _ in range({CROWD}):
        bus.send_envelope(Envelope(1086, b"", 1, 1, 1, 0))
    time.sleep(0.5)
    bus.send_envelope(Envelope({LAST}, b"", 1, 1, 1, 0))
    time.sleep(0.5)
print('{{"dodo": "verdict", "outcome": "passed", "reason": "it crowded", "checks": []}}', flush=True)
"""


def crowded(bench: Bench) -> Plan:
    """A judge that sends more than the recorder's small buffer holds."""
    plan = bench.plan()
    cid = Flag("cid", str(plan.cid))
    recorder = PlannedService(
        "environment", "dodo-recorder", "rec-recorder", "x", bench.script("recorder", SLOW_RECORDER)
    )
    judge = PlannedService("evaluation", "judge", "x", "x", bench.script("crowd", CROWDING_JUDGE), judge=True)
    flags = (Flag("rec", "test.rec", "report"), cid)
    return replace(plan, services=(replace(recorder, flags=flags), replace(judge, flags=(cid,))))


@pytest.mark.slow
def test_what_the_recorder_lost_reaches_the_outcome(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DODO_LEASES", str(tmp_path / "leases"))
    bench = Bench(tmp_path, "host")
    plan = crowded(bench)
    (outcome,) = bench.run(plan)
    assert (outcome.outcome, outcome.reason) == ("passed", "it crowded")
    recorded = [e.data_type for e in read_envelopes(tmp_path / "report" / plan.slug / "test.rec")]
    assert recorded[-2:] == [LAST, RECORDING_END]
    lost = CROWD - recorded.count(1086)
    assert lost > 0
    note = f"service 'dodo-recorder' lost {lost} messages, because its receive buffer was full"
    assert outcome.notes == (f"{note}: the recording is incomplete",)
    assert f"{lost} messages were lost" in bench.log(plan, "environment.dodo-recorder")
