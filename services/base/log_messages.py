"""A service's log as LogMessages on the bus."""

import logging
from collections.abc import Iterator
from contextlib import contextmanager, suppress

from dodo_dsl.opendlv.bus.session import Session, SessionError
from dodo_dsl.opendlv.messages.codec import MessageError

LOG_MESSAGE = "opendlv.system.LogMessage"
SEVERITIES = ((logging.CRITICAL, 2), (logging.ERROR, 3), (logging.WARNING, 4), (logging.INFO, 6), (logging.DEBUG, 7))
"""The severity (RFC 5424, table 2) of lines from each level on; 6 is the message's default."""
LONGEST = 1000


@contextmanager
def published(session: Session, sender_stamp: int | None) -> Iterator[None]:
    """Send the log, and the error that ends the service, under a sender stamp; None sends nothing."""
    if sender_stamp is None:
        yield
        return
    handler = _LogSender(session, sender_stamp)
    logging.getLogger().addHandler(handler)
    try:
        yield
    except Exception as error:
        handler.send(logging.CRITICAL, str(error) or type(error).__name__)
        raise
    finally:
        logging.getLogger().removeHandler(handler)


class _LogSender(logging.Handler):
    """Sends log lines; one that cannot be sent is still in the log on stderr."""

    def __init__(self, session: Session, sender_stamp: int) -> None:
        super().__init__()
        self._session, self._stamp = session, sender_stamp
        self._type = session.messages.type(LOG_MESSAGE)

    def emit(self, record: logging.LogRecord) -> None:
        self.send(record.levelno, record.getMessage())

    def send(self, level: int, text: str) -> None:
        severity = next((number for least, number in SEVERITIES if level >= least), 7)
        description = " ".join(text.split())[:LONGEST]
        with suppress(SessionError, MessageError):
            self._session.send(self._type(level=severity, description=description), None, self._stamp)
