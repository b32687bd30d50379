"""Drive along a corridor by the Kiwi car's range sensors alone, without a camera.

    python driver.py --cid=111 --verbose

Hears the distance ahead (ultrasonic, DistanceReading/0) and the voltages of the infrared sensors on the left
(VoltageReading/1) and on the right (VoltageReading/3). When it has all three of one time, it answers with one
GroundSteeringRequest and one PedalPositionRequest that carry this time.
"""

import argparse
import signal
import sys

from dodo_dsl.opendlv import Envelope, Session

DISTANCE, VOLTAGE = "opendlv.proxy.DistanceReading", "opendlv.proxy.VoltageReading"
FRONT, LEFT, RIGHT = 0, 1, 3  # sender stamps
REQUESTS = ("opendlv.proxy.GroundSteeringRequest", "opendlv.proxy.PedalPositionRequest")

METRES_TIMES_VOLTS = 0.128  # of a GP2Y0A41SK0F, whose voltage falls with the distance
FARTHEST = 0.4  # m, what it sees
STEERING_LIMIT = 0.290888  # rad
GAIN, DAMPING = 1.5, 0.5  # rad/m, rad s/m
PEDAL = 0.08  # 0.52 m/s
STOP = 0.25  # m, to what is ahead


def distance(voltage: float) -> float:
    """What an infrared sensor measures, in m."""
    return min(METRES_TIMES_VOLTS / max(voltage, 1e-3), FARTHEST)


class Driver:
    """Keeps to the middle of the corridor, and stops before what is in its way."""

    def __init__(self) -> None:
        self._last: tuple[int, float] | None = None

    def drive(self, time: int, front: float, left: float, right: float) -> tuple[float, float]:
        """The steering request (rad, left is positive) and the pedal; time in us, front in m, left and right in V."""
        offset = distance(left) - distance(right)
        before, past = self._last or (time, offset)
        rate = (offset - past) / ((time - before) / 1e6) if time > before else 0.0
        self._last = time, offset
        steering = GAIN * offset + DAMPING * rate
        return max(-STEERING_LIMIT, min(STEERING_LIMIT, steering)), PEDAL if front > STOP else 0.0


class Readings:
    """Collects readings until those of all sensors have come for one time."""

    def __init__(self, session: Session) -> None:
        types = {(DISTANCE, FRONT): "distance", (VOLTAGE, LEFT): "voltage", (VOLTAGE, RIGHT): "voltage"}
        self._messages = session.messages
        self._fields = {(session.messages.id(name), stamp): field for (name, stamp), field in types.items()}
        self._values: dict[tuple[int, int], float] = {}
        self._time = 0

    def hear(self, envelope: Envelope) -> list[float] | None:
        """The readings ahead, left and right when this one completes them."""
        key = (envelope.data_type, envelope.sender_stamp)
        if key not in self._fields:
            return None
        if envelope.sample_time != self._time:
            self._time = envelope.sample_time
            self._values.clear()
        message = self._messages.decode(envelope.data_type, envelope.payload)
        self._values[key] = getattr(message, self._fields[key])
        return [self._values[key] for key in self._fields] if len(self._values) == len(self._fields) else None


def main() -> int:
    parser = argparse.ArgumentParser(description="Drive along a corridor by range sensors.")
    parser.add_argument("--cid", type=int, required=True, help="the bus, 1 to 254")
    parser.add_argument("--verbose", action="store_true", help="print what is done")
    flags = parser.parse_args()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))

    driver = Driver()
    with Session(flags.cid) as session:
        readings, answered = Readings(session), 0
        session.hear_only(session.messages.id(name) for name in (DISTANCE, VOLTAGE))
        while True:
            envelope = session.receive(None)
            values = readings.hear(envelope) if envelope else None
            if envelope is None or values is None or envelope.sample_time == answered:
                continue
            answered = envelope.sample_time
            angle, pedal = driver.drive(answered, *values)
            steer, press = map(session.messages.type, REQUESTS)
            session.send(steer(groundSteering=angle), answered)
            session.send(press(position=pedal), answered)
            if flags.verbose:
                print(f"{values[0]:.2f} m, {values[1]:.2f} V, {values[2]:.2f} V: steering {angle:.3f} rad", flush=True)


if __name__ == "__main__":
    sys.exit(main())
