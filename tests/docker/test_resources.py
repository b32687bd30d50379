"""What an application in containers uses, by its control groups, where the engine has them."""

import pytest

from dodo_dsl.outcome import Outcome
from tests.docker.compose import Crate
from tests.run.helpers import AFTER_START, PASS, READY, WAIT
from tests.run.process.test_resources import FORKS, LEAKS

pytestmark = [pytest.mark.engine, pytest.mark.usefixtures("images")]

JUDGE = READY + AFTER_START + "time.sleep(3)\n" + PASS


def test_each_manner_has_its_figures(crate: Crate) -> None:
    manners = {"leaks": LEAKS, "forks": FORKS + WAIT}
    outcomes = crate.run(*(crate.job(n, JUDGE, text, mem_limit="400m") for n, text in manners.items()))
    have_limits(outcomes)
    (forks,) = outcomes["forks"].resources
    assert forks.processor_s > 0.3, "of a child that was waited for"
    assert 50e6 < forks.peak_memory_bytes < 100e6, "what four processes share counts once"


def have_limits(outcomes: dict[str, Outcome]) -> None:
    for slug, outcome in outcomes.items():
        (use,) = outcome.resources
        assert (outcome.outcome, use.service, use.memory_limit_bytes) == ("passed", "app", 400 << 20), outcome.reason
        told = [note for note in outcome.notes if "it would reach its limit of 419 MB in " in note]
        assert bool(told) is slug.endswith("leaks"), (use, outcome.notes)
