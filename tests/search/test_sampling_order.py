"""The order of a search, with margins that follow from the values."""

import itertools

import pytest

from dodo_dsl.search import search_loop
from dodo_dsl.search.search_loop import FIRST, PATIENCE, PROPOSED, SWEPT, Candidate, SamplingOrder, key
from dodo_dsl.search.space import Space, sweep, texts
from tests.search.test_space import space

RANGES = ", ".join(f"r{number}: {{from: 0, to: 1, nominal: 0.5}}" for number in range(4))
SPACE = space(f"{{{RANGES}}}")


def margin(one: Candidate) -> float:
    """Fails where two ranges are within a tenth of an end, 1 % of the space; one of them tells so before."""
    first, _, third, _ = (float(text) for text in texts(one.values).values())
    return -0.4 if first > 0.9 and third < 0.1 else 0.5 - 0.3 * abs(first - 0.5)


def driven(runs: int, seed: int, of: Space = SPACE, proposes: bool = True) -> list[tuple[Candidate, float]]:
    margins: dict[tuple[str, ...], float | None] = {}
    found = []
    for batch in SamplingOrder(of, runs, seed, proposes).generations(margins):
        found += [(one, margin(one)) for one in batch]
        margins.update({key(one.values): found_margin for one, found_margin in found[-len(batch) :]})
    return found


@pytest.mark.thorough
def test_the_sweep_comes_by_turns_with_what_is_proposed() -> None:
    order = [one for one, _ in driven(23, 1)]
    assert [one.swept for one in order[FIRST : FIRST + SWEPT + PROPOSED]] == [True] * SWEPT + [False] * PROPOSED
    swept = [key(one.values) for one in order if one.swept]
    assert swept == [key(values) for values in sweep(SPACE, len(swept), 1)]
    assert len({key(one.values) for one in order}) == 23
    assert all(one.swept for one, _ in driven(20, 1, proposes=False))


@pytest.mark.thorough
def test_a_crash_does_not_hide_by_how_little_good_values_differ() -> None:
    """As a tuning has it: the objective, negative, of a hill within a hundredth, beside values that crash."""

    def objective(one: Candidate) -> float:
        off = sum((float(text) - 0.37) ** 2 for text in texts(one.values).values())
        return -0.10 + 0.04 * off if off < 0.5 else 0.65

    margins: dict[tuple[str, ...], float | None] = {}
    for batch in SamplingOrder(SPACE, 48, 0, seeks_best=True, swept=1).generations(margins):
        margins.update({key(one.values): objective(one) for one in batch})
    assert min(found for found in margins.values() if found is not None) < -0.0995


@pytest.mark.thorough
def test_more_drives_go_on_with_fewer() -> None:
    assert driven(18, 3) == driven(27, 3)[:18]


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.thorough
def test_a_corner_of_a_hundredth_is_found(seed: int) -> None:
    """Uniform random drives need 69 in the median; these find it in half of that."""
    assert any(found < 0 for _, found in driven(34, seed))


def of_each(failing: bool) -> list[list[bool]]:
    """Whether the candidates of each generation are of the sweep, where one of the first fails, or none ever."""
    margins: dict[tuple[str, ...], float | None] = {}
    found = []
    for batch in SamplingOrder(SPACE, FIRST + 8 * (PATIENCE + 3), 0).generations(margins):
        found.append([one.swept for one in batch])
        margins.update({key(one.values): -0.5 if failing and not margins else 0.5 for one in batch})
    return found


def test_the_sweep_gets_more_where_proposals_find_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever is proposed: here further points of a sweep."""
    others = sweep(SPACE, 256, 7)
    monkeypatch.setattr(search_loop, "propose", lambda *words: list(itertools.islice(others, words[3])))
    patient, impatient = [True] * SWEPT + [False] * PROPOSED, [True] * 7 + [False]
    _, *generations = of_each(failing=False)
    assert generations == [patient] * PATIENCE + [impatient] * 3
    _, *generations = of_each(failing=True)
    assert generations == [patient] * (PATIENCE + 3)


def test_a_space_that_is_exhausted_ends_the_search() -> None:
    small = space("{m: {among: [a, b], nominal: b}, n: {from: 0, to: 2, nominal: 1}}", "n")
    margins: dict[tuple[str, ...], float | None] = {}
    batches = SamplingOrder(small, 1000, 0).generations(margins)
    number = 0
    for batch in batches:
        number += 1
        margins.update({key(one.values): 0.1 * len(key(one.values)[1]) for one in batch})
    assert (len(margins), number < 9) == (6, True)


def test_drives_in_error_say_nothing() -> None:
    margins: dict[tuple[str, ...], float | None] = {}
    for batch in SamplingOrder(SPACE, 20, 0).generations(margins):
        margins.update({key(one.values): None for one in batch})
    assert len(margins) == 20
