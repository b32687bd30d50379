import numpy as np

from services.rec_replay.selection import Player

S = 1_000_000


def player(rewinds: bool = False) -> Player:
    one = Player(np.array([0, 0, S, 3 * S]), rewinds)
    one.advance(10 * S)
    return one


def at(one: Player, now: int) -> list[tuple[int, float]]:
    """Number and time in seconds of what is due at `now`."""
    one.advance(now)
    due = []
    while (entry := one.take()) is not None:
        due.append((entry[0], entry[1] / S))
    return due


def test_entries_come_at_their_times() -> None:
    one = player()
    assert at(one, 11 * S) == []  # nothing before play
    one.playing = True
    assert at(one, 11 * S) == [(0, 11), (1, 11)]
    assert at(one, 12 * S - 1) == []
    assert at(one, 12 * S + 5) == [(2, 12)]
    assert not one.ended
    assert at(one, 60 * S) == [(3, 14)]
    assert one.ended and at(one, 70 * S) == []


def test_it_begins_anew_at_its_end() -> None:
    one = player(rewinds=True)
    one.playing = True
    assert at(one, 13 * S) == [(0, 10), (1, 10), (2, 11), (3, 13)]
    assert one.round == 1
    assert at(one, 13 * S + 1) == [(0, 13), (1, 13)]


def test_a_part_without_duration_does_not_hold_it_up() -> None:
    one = Player(np.array([0]), rewinds=True)
    one.playing = True
    assert at(one, 5 * S) == [(0, 5)]
    assert at(one, 6 * S) == [(0, 5)]
