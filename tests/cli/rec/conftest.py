"""Recordings as in the tests of what ``dodo rec`` does."""

from tests.rec.conftest import record

__all__ = ["record"]
