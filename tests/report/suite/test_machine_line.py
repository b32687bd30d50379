"""The line about a busy machine."""

from dataclasses import replace

from dodo_dsl.outcome import MachineLoad, Wait
from dodo_dsl.report.overview import machine_line


def test_the_line() -> None:
    load = MachineLoad(7.5, 2, Wait(1.0, 2.0, 1.9, "app"), Wait(1.5, 0.5, 0.4, "camera"), 0.61, 7.5, 0.05, 0.02, 0.06)
    assert machine_line(load) == (
        "the application waited 2.0 s of 7.5 s for a processor (app); "
        "DoDo's services waited 0.5 s of 7.5 s for a processor (camera); "
        "others took 61 % of 2 cores; 5 % of the pictures came late, by up to 0.06 s"
    )
    assert machine_line(replace(load, paused_s=0.061)).endswith("; the emulated rig stood still for 0.06 s")
    assert machine_line(MachineLoad(7.5)) == "waits for a processor were not measured"
