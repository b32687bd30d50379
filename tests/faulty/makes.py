"""All faults by the program that they alter."""

from tests.faulty.kiwi import PERCEPTION, STEERING, Make
from tests.faulty.of_conduct import PERCEPTION_CONDUCT, STEERING_CONDUCT
from tests.faulty.of_perception import PERCEPTION_FAULTS
from tests.faulty.of_steering import STEERING_FAULTS

GOOD = "none"
MAKES: dict[str, dict[str, Make]] = {
    PERCEPTION: {**PERCEPTION_FAULTS, **PERCEPTION_CONDUCT},
    STEERING: {**STEERING_FAULTS, **STEERING_CONDUCT},
}
NAMES = tuple(dict.fromkeys(name for faults in MAKES.values() for name in faults))
