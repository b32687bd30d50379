"""libcluon in a process of its own (pycluon): a line of JSON on stdin is an order, one on stdout its answer.

Run: python cluon_peer.py CID
"""

import datetime
import json
import sys
import threading
from typing import Any

import pycluon

EPOCH = datetime.datetime(1970, 1, 1)
MICROSECOND = datetime.timedelta(microseconds=1)


def say(**answer: Any) -> None:
    with OUTPUT:
        print(json.dumps(answer), flush=True)


def received(envelope: pycluon.Envelope) -> None:
    say(
        id=envelope.data_type,
        payload=envelope.serialized_data.hex(),
        sent=(envelope.sent_at - EPOCH) // MICROSECOND,
        received=(envelope.received_at - EPOCH) // MICROSECOND,
        sampled=(envelope.sampled_at - EPOCH) // MICROSECOND,
        stamp=envelope.sender_stamp,
    )


def send(id: int, payload: str, sent: int, sampled: int, stamp: int) -> None:
    envelope = pycluon.Envelope()
    envelope.data_type, envelope.serialized_data, envelope.sender_stamp = id, bytes.fromhex(payload), stamp
    envelope.sent_at = EPOCH + sent * MICROSECOND
    envelope.sampled_at = EPOCH + sampled * MICROSECOND
    SESSION.send(envelope)


def create(name: str, size: int) -> None:
    MEMORY[name] = pycluon.SharedMemory(name, size)
    say(valid=MEMORY[name].valid())


def attach(name: str) -> None:
    create(name, 0)


def fill(name: str, byte: int, time: int) -> None:
    memory = MEMORY[name]
    memory.lock()
    memory.data = bytes([byte]) * len(memory.data)
    memory.timestamp = EPOCH + time * MICROSECOND
    memory.unlock()
    memory.notify_all()
    say(done=True)


def wait(name: str, frames: int) -> None:
    memory = MEMORY[name]
    for _ in range(frames):
        memory.wait()
        memory.lock()
        content, time = bytes(memory.data), (memory.timestamp - EPOCH) // MICROSECOND
        memory.unlock()
        say(byte=content[0], same=set(content) == {content[0]}, size=len(content), time=time)


def close(name: str) -> None:
    del MEMORY[name]
    say(done=True)


OUTPUT = threading.Lock()
MEMORY: dict[str, Any] = {}
SESSION = pycluon.OD4Session(int(sys.argv[1]), received)
say(ready=True)
for line in sys.stdin:
    order, arguments = json.loads(line)
    {"send": send, "create": create, "attach": attach, "fill": fill, "wait": wait, "close": close}[order](**arguments)
MEMORY.clear()
