"""Drives straight ahead, without looking at the pictures."""

import argparse

from dodo_dsl.opendlv.session import Session
from dodo_dsl.opendlv.shared_memory import SharedMemory

parser = argparse.ArgumentParser()
parser.add_argument("--cid", type=int)
parser.add_argument("--name")
flags = parser.parse_args()
with SharedMemory.attach(flags.name) as memory, Session(flags.cid) as session:
    while memory.wait():
        with memory.lock():
            sampled = memory.sample_time()
        session.send(session.messages.type("opendlv.proxy.GroundSteeringRequest")(groundSteering=0.0), sampled)
        session.send(session.messages.type("opendlv.proxy.PedalPositionRequest")(position=0.1), sampled)
