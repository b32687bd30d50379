import numpy as np
import pytest

from services.rec_replay.selection import PAUSE, PLAY, SEEK, STEP, Player

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
    one.play()
    assert at(one, 11 * S) == [(0, 11), (1, 11)]
    assert at(one, 12 * S - 1) == []
    assert at(one, 12 * S + 5) == [(2, 12)]
    assert not one.ended
    assert at(one, 60 * S) == [(3, 14)]
    assert one.ended and at(one, 70 * S) == []


def test_a_pause_moves_what_comes_after_it() -> None:
    one = player()
    one.play()
    at(one, 10 * S)
    one.advance(10 * S + S // 2)
    one.command(PAUSE, 0)
    assert at(one, 90 * S) == []
    one.command(PLAY, 0)
    assert at(one, 90 * S + S // 2) == [(2, 90.5)]


def test_steps_take_one_entry_each_and_pause() -> None:
    one = player()
    one.play()
    one.command(STEP, 0)
    assert at(one, 20 * S) == [(0, 20)]
    one.command(STEP, 0)
    one.command(STEP, 0)
    assert at(one, 30 * S) == [(1, 30), (2, 30)]
    one.command(PLAY, 0)
    assert at(one, 32 * S) == [(3, 32)]


@pytest.mark.parametrize(("share", "number"), [(0.0, 0), (0.5, 2), (0.6, 2), (1.0, 3)])
def test_seeking_is_by_entries(share: float, number: int) -> None:
    one = player()
    one.command(SEEK, share)
    assert one.jumped and one.position == number
    assert at(one, 20 * S) == []  # still paused
    one.play()
    assert at(one, 20 * S)[:1] == [(number, 20)]


@pytest.mark.parametrize(("command", "seek_to"), [(0, 0), (5, 0), (SEEK, 1.5), (SEEK, -0.1), (SEEK, float("nan"))])
def test_what_is_no_command_changes_nothing(command: int, seek_to: float, caplog: pytest.LogCaptureFixture) -> None:
    one = player()
    one.play()
    one.command(command, seek_to)
    assert at(one, 10 * S) == [(0, 10), (1, 10)]
    assert "unknown player command" in caplog.text


def test_it_begins_anew_at_its_end() -> None:
    one = player(rewinds=True)
    one.play()
    assert at(one, 13 * S) == [(0, 10), (1, 10), (2, 11), (3, 13)]
    assert one.jumped
    assert at(one, 13 * S + 1) == [(0, 13), (1, 13)]


def test_a_part_without_duration_does_not_hold_it_up() -> None:
    one = Player(np.array([0]), rewinds=True)
    one.play()
    assert at(one, 5 * S) == [(0, 5)]
    assert at(one, 6 * S) == [(0, 5)]
