"""Faults of an application that drives by range sensors: it takes their readings for something else."""

from tests.faulty.kiwi import Make, Program


def stamps_swapped(driver: Program) -> None:
    """What the left sensor says is taken for the right one's."""
    driver.LEFT, driver.RIGHT = driver.RIGHT, driver.LEFT


def volts_as_metres(driver: Program) -> None:
    """A voltage, which falls with the distance, is taken for the distance."""
    driver.distance = lambda voltage: voltage


def metres_as_centimetres(driver: Program) -> None:
    """Everything ahead is a hundred times nearer."""
    drive = driver.Driver.drive
    driver.Driver.drive = lambda self, time, front, *sides: drive(self, time, front / 100, *sides)


RANGE_FAULTS: dict[str, Make] = {
    "ranges-swapped": stamps_swapped,
    "ranges-volts": volts_as_metres,
    "ranges-centimetres": metres_as_centimetres,
}
