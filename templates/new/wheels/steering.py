import argparse

from dodo_dsl.opendlv import Session

FRONT, LEFT, RIGHT = 0, 1, 3  # sender stamps of the range sensors, which look ahead, and ahead to the left and right
PEDAL, GAIN, STOP = 0.4, 0.4, 0.2  # GAIN in pedal per m, STOP in m
parser = argparse.ArgumentParser()
parser.add_argument("--cid", type=int, required=True)
flags = parser.parse_args()

with Session(flags.cid) as session:
    pedal = session.messages.type("opendlv.proxy.PedalPositionRequest")
    session.hear_only([session.messages.id("opendlv.proxy.DistanceReading")])
    time, distances = 0, {}
    while True:
        envelope = session.receive(None)
        if envelope is None:
            continue
        if envelope.sample_time != time:
            time, distances = envelope.sample_time, {}
        reading = session.messages.decode(envelope.data_type, envelope.payload)
        distances[envelope.sender_stamp] = reading.distance
        if not {FRONT, LEFT, RIGHT} <= distances.keys():
            continue  # not all sensors have spoken of this time
        speed = PEDAL if distances[FRONT] > STOP else 0.0
        turn = max(-speed, min(speed, GAIN * (distances[LEFT] - distances[RIGHT])))
        session.send(pedal(position=speed - turn), time, 0)  # the left wheel
        session.send(pedal(position=speed + turn), time, 1)  # the right one
        distances = {}
