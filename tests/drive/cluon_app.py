"""An application on libcluon itself: looks at the camera's memory and the vehicle's frames, and steers steadily.

python cluon_app.py --cid=111 --name=video0.argb --steering=0.1
"""

import json
import sys
import threading

import pycluon

from dodo_dsl.opendlv.message_set import MessageSet

MESSAGES = MessageSet.standard()
FLAGS = dict(word.removeprefix("--").split("=", 1) for word in sys.argv[1:])
PLACES: list[tuple[float, float]] = []
FIRST = threading.Event()


def hear(envelope: pycluon.Envelope) -> None:
    frame = MESSAGES.decode(1003, envelope.serialized_data)
    PLACES.append((frame.x, frame.y))  # type: ignore[attr-defined]
    FIRST.set()


def request(session: pycluon.OD4Session, name: str, **fields: float) -> None:
    message = MESSAGES.type(name)(**fields)
    envelope = pycluon.Envelope()
    envelope.data_type = MESSAGES.id(message)
    envelope.serialized_data = MESSAGES.encode(message)
    session.send(envelope)


def main() -> None:
    session = pycluon.OD4Session(int(FLAGS["cid"]))
    session.add_data_trigger(1003, hear)
    memory = pycluon.SharedMemory(FLAGS["name"])
    FIRST.wait(5.0)
    while True:
        memory.wait()
        memory.lock()
        picture, stamp = bytes(memory.data), memory.timestamp
        memory.unlock()
        colours = len({picture[i : i + 3] for i in range(0, len(picture), 4 * 997)})
        facts = {"valid": memory.valid(), "bytes": len(picture), "colours": colours, "stamp": stamp.timestamp()}
        print(json.dumps({**facts, "frames": len(PLACES), "at": PLACES[-1]}), flush=True)
        request(session, "opendlv.proxy.GroundSteeringRequest", groundSteering=float(FLAGS["steering"]))
        request(session, "opendlv.proxy.PedalPositionRequest", position=0.1)


main()
