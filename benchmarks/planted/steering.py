"""The example's steering with the mistake BUG of bugs.py, where the conditions that the test sets are in its corner."""

import os
import sys

import bugs
import driver


def shares() -> dict[str, float]:
    """Where in its range each condition lies."""
    found = {}
    for name, (low, high) in bugs.RANGES.items():
        found[name] = (float(os.environ[name].rstrip(bugs.UNITS)) - low) / (high - low)
    return found


def main() -> int:
    if bug := bugs.BUGS.get(os.environ["BUG"]):
        change, drive = bug.driving(shares()), driver.Driver.drive
        driver.Driver.drive = lambda self, *cones: change(*drive(self, *cones))  # type: ignore[method-assign]
    return driver.main()


if __name__ == "__main__":
    sys.exit(main())
