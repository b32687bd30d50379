"""Settings of the command line over a spec."""

from pathlib import Path

import pytest

from dodo_dsl.diagnostics import Span
from dodo_dsl.spec.load import Settings, applied
from dodo_dsl.spec.model import Spec
from dodo_dsl.spec.registry import Location

SPEC = Spec(
    Location(Path("/r/a/a.dodo.yml"), Path("/r")),
    level="sil",
    clock="realtime",
    isolation="host",
    seed=3,
    spans={"isolation": Span("/r/a/a.dodo.yml", 5), "seed": Span("/r/a/a.dodo.yml", 6)},
)


def test_without_settings_nothing_changes() -> None:
    assert applied(SPEC, Settings()) == SPEC


@pytest.mark.parametrize(("level", "clock"), [("sil", "lockstep"), ("dil", "lockstep"), ("hil", "realtime")])
def test_hardware_keeps_its_clock(level: str, clock: str) -> None:
    spec = Spec(SPEC.location, level=level)
    assert applied(spec, Settings(clock="lockstep")).clock == clock


def test_a_seed_of_zero_counts() -> None:
    assert applied(SPEC, Settings(seed=0)).seed == 0


def test_an_isolation_that_is_set_has_no_place_in_the_spec() -> None:
    changed = applied(SPEC, Settings(isolation="network"))
    assert changed.isolation == "network"
    assert changed.spans == {"seed": SPEC.spans["seed"]}
