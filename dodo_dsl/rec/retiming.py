"""A recording whose messages have sample times of several drives, as one in which others' messages were processed."""

import numpy as np

from dodo_dsl.opendlv.bus.envelope import encode_frame
from dodo_dsl.opendlv.messages.varints import Numbers
from dodo_dsl.opendlv.recordings import timing
from dodo_dsl.opendlv.recordings.recording import Recording

_APART = 1_000_000
"""Microseconds between the delays of two senders from which on one of them sends by another clock."""


def receipts(recording: Recording, rows: Numbers) -> Numbers | None:
    """When each message was received, in us, where the sample times of rows come from several drives; else None."""
    received = np.concatenate([batch.times[1] for batch in recording.batches()])
    sampled = recording.index["sampled"]
    known = rows[(received[rows] != 0) & (sampled[rows] != 0)]
    delays = [np.median((received - sampled)[part]) for part in timing.streams(recording.index, known)]
    is_apart = len(delays) > 1 and max(delays) - min(delays) > _APART
    return np.where(received == 0, recording.index["time"], received) if is_apart and received[rows].all() else None


def retimed(recording: Recording, times: Numbers) -> bytes:
    """The recording with these sample times."""
    pairs = zip(recording.envelopes(), times.tolist(), strict=True)
    return b"".join(encode_frame(envelope._replace(sample_time=time)) for envelope, time in pairs)
