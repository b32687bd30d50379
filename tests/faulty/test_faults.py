"""The table of faults, and which of them a program has; that each is caught, ``test_kill`` and ``make proof`` show."""

from pathlib import Path

from tests.faulty import of_ros
from tests.faulty.makes import NAMES, fault_of
from tests.faulty.of_ranges import RANGE_FAULTS
from tests.faulty.page import GAPS
from tests.faulty.table import FAULTS, RANGES, ROS


def test_the_table_is_complete_and_names_real_tests() -> None:
    assert set(FAULTS) == set(NAMES) and set(RANGES) == set(RANGE_FAULTS) and set(ROS) == set(of_ros.FAULTS)
    assert len(FAULTS) >= 40
    for fault in FAULTS.values():
        folder = fault.test.partition("--")[0]
        assert (Path(__file__).parents[2] / "tests_registry" / folder / f"{folder}.dodo.yml").is_file(), fault
    kinds = {fault.kind for fault in FAULTS.values()}
    assert {name for reasons in GAPS.values() for name in reasons} <= kinds | set(FAULTS)


def test_a_fault_belongs_to_a_bus_where_the_flag_says_so() -> None:
    both = "128=steering-nan,130=silent"
    assert [fault_of(both, cid) for cid in ("128", "129", "130")] == ["steering-nan", "none", "silent"]
    assert fault_of("steering-nan", "129") == "steering-nan"
