"""An application with libcluon in it (pycluon): sends frames and reports the first picture that follows.

Run: python libcluon_viewer.py CID SENDER_STAMP FRAME_AS_HEX NAME...
"""

import datetime
import hashlib
import json
import sys
import threading

import pycluon

EPOCH = datetime.datetime(1970, 1, 1)


def keep_sending(session: pycluon.OD4Session, payload: bytes, stamp: int, over: threading.Event) -> None:
    while not over.wait(0.02):
        envelope = pycluon.Envelope()
        envelope.data_type, envelope.serialized_data, envelope.sender_stamp = 1003, payload, stamp
        envelope.sent_at = envelope.sampled_at = datetime.datetime.now(datetime.UTC).replace(tzinfo=None)
        session.send(envelope)


def look(memory: pycluon.SharedMemory) -> dict[str, object]:
    memory.lock()
    data, time = bytes(memory.data), memory.timestamp
    memory.unlock()
    microseconds = (time - EPOCH) // datetime.timedelta(microseconds=1)
    return {"size": len(data), "sha256": hashlib.sha256(data).hexdigest(), "time": microseconds}


def main(cid: str, stamp: str, payload: str, *names: str) -> None:
    session = pycluon.OD4Session(int(cid), lambda _envelope: None)
    memories = [pycluon.SharedMemory(name, 0) for name in names]
    over = threading.Event()
    sender = threading.Thread(target=keep_sending, args=(session, bytes.fromhex(payload), int(stamp), over))
    sender.start()
    memories[-1].wait()
    print(json.dumps([look(memory) for memory in memories]), flush=True)
    over.set()
    sender.join()


if __name__ == "__main__":
    main(*sys.argv[1:])
