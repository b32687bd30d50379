"""The camera's state, for observers of the bus."""

from dodo_dsl.opendlv.messages.message_set import MessageSet
from services.base import Output

STATES = ("the camera gives pictures", "the camera gives no picture")
"""Descriptions by code."""
SHORTEST = 1_000_000
"""us without a picture that never count as a loss."""


class CameraTelemetry:
    """A SystemStatusMessage at first and whenever the state changes; none without a sender stamp.

    ``patience`` in us: for how long there may be no picture, if that is more than 1 s.
    """

    def __init__(self, messages: MessageSet, sender_stamp: int | None, patience: int) -> None:
        self._type = messages.type("opendlv.system.SystemStatusMessage")
        self._stamp, self._patience = sender_stamp, max(SHORTEST, patience)
        self._seen: int | None = None
        self._code: int | None = None

    def update(self, has_picture: bool, now: int) -> tuple[Output, ...]:
        """Messages at an instant (us) at which there was a picture or not."""
        if has_picture or self._seen is None:
            self._seen = now
        code = int(now - self._seen > self._patience)
        if self._stamp is None or code == self._code:
            return ()
        self._code = code
        return (Output(self._type(code=code, description=STATES[code]), self._stamp),)
