"""Where a player is in its part of a recording, by test time and by commands; pure, without a recording."""

import logging

from dodo_dsl.opendlv.messages.varints import Numbers

PLAY, PAUSE, SEEK, STEP = 1, 2, 3, 4

_log = logging.getLogger(__name__)


class Player:
    """Computes which entries are due. ``due`` holds the time of each in microseconds from the start, ascending.

    It waits for `play` before anything is due. With `rewinds` it begins anew at its end; else it is `ended` then.
    """

    def __init__(self, due: Numbers, rewinds: bool = False) -> None:
        self.position = 0
        self.playing = False
        self.jumped = False
        self._due = due.tolist()
        self.rewinds = rewinds
        self._elapsed = 0
        self._now: int | None = None
        self._steps = 0

    def __len__(self) -> int:
        return len(self._due)

    @property
    def ended(self) -> bool:
        """Whether all has been played."""
        return self.position >= len(self._due)

    def play(self) -> None:
        """Play from here."""
        self.playing = True

    def command(self, command: int, seek_to: float) -> None:
        """PlayerCommand: play, pause, seek to a share (0 to 1) of the entries, or step by one entry, which pauses."""
        if command == PLAY:
            self.play()
        elif command == PAUSE:
            self.playing = False
        elif command == STEP:
            self.playing = False
            self._steps += 1
        elif command == SEEK and 0.0 <= seek_to <= 1.0:
            self._seek(min(int(len(self) * seek_to), len(self) - 1))
        else:
            _log.warning(
                "unknown player command %d to %g, expected 1 play, 2 pause, 3 seek 0 to 1, 4 step", command, seek_to
            )

    def advance(self, now: int) -> None:
        """It is `now`, microseconds of test time."""
        if self.playing and self._now is not None:
            self._elapsed += now - self._now
        self._now = now

    def when(self, position: int, in_next_round: bool = False) -> int:
        """The test time at which an entry is due if the player is not paused before."""
        due: int = self._due[position] + (self._due[-1] if in_next_round else 0)
        return (self._now or 0) + due - self._elapsed

    def take(self) -> tuple[int, int] | None:
        """The next entry that is due, by number, and the test time at which it was; None when there is none."""
        if self.ended and self.rewinds and self.playing:
            self._elapsed = self._elapsed - self._due[-1] if self._due[-1] else 0
            self.position, self.jumped = 0, True
            return None  # one round per update, as a part may have no duration
        if self.ended:
            return None
        due = self._due[self.position]
        if self._steps:
            self._steps -= 1
            self._elapsed = due
        elif not self.playing or due > self._elapsed:
            return None
        self.position += 1
        return self.position - 1, (self._now or 0) - (self._elapsed - due)

    def _seek(self, position: int) -> None:
        self.position, self.jumped = position, True
        self._elapsed = self._due[position]
