"""The message with which the runner tells a test's bus that everything is ready."""

import time

from dodo_dsl.opendlv.envelope import Envelope, encode_frame
from dodo_dsl.opendlv.messages import MessageSet


def begin_frame(seed: int) -> bytes:
    """``dodo.TestBegin`` as a datagram, sampled now."""
    messages = MessageSet.standard()
    message = messages.type("dodo.TestBegin")(seed=seed)
    now = time.time_ns() // 1000
    return encode_frame(Envelope(messages.id(message), messages.encode(message), now, 0, now, 0))
