"""All faults by the program that they alter."""

from tests.faulty.kiwi import DRIVER, PERCEPTION, STEERING, Make
from tests.faulty.of_conduct import PERCEPTION_CONDUCT, STEERING_CONDUCT
from tests.faulty.of_perception import PERCEPTION_FAULTS
from tests.faulty.of_ranges import RANGE_FAULTS
from tests.faulty.of_steering import STEERING_FAULTS

GOOD = "none"
MAKES: dict[str, dict[str, Make]] = {
    PERCEPTION: {**PERCEPTION_FAULTS, **PERCEPTION_CONDUCT},
    STEERING: {**STEERING_FAULTS, **STEERING_CONDUCT},
}
"""Of the Kiwi application."""
PROGRAMS: dict[str, dict[str, Make]] = {**MAKES, DRIVER: RANGE_FAULTS}
NAMES = tuple(dict.fromkeys(name for faults in MAKES.values() for name in faults))


def fault_of(text: str, cid: str) -> str:
    """The fault in ``NAME``, or of a bus in ``CID=NAME,CID=NAME``; raises ValueError for one that does not exist."""
    faults = dict(each.split("=", 1) for each in text.split(",")) if "=" in text else {cid: text}
    name = faults.get(cid, GOOD)
    if name not in (GOOD, *NAMES, *RANGE_FAULTS):
        raise ValueError(f"'{name}' is not a fault: they stand in tests/faulty/faults.yml and faults_of_ranges.yml")
    return name
