"""A fork server that was started early belongs to the backend that took it; one that nobody took is ended at once."""

import argparse
import tempfile

import pytest

from dodo_dsl.cli.run.loading import loading


def options(**chosen: str) -> argparse.Namespace:
    return argparse.Namespace(**{"backend": None, "isolation": None} | chosen)


@pytest.mark.parametrize("chosen", [{"backend": "docker"}, {"isolation": "host"}])
def test_none_where_none_is_needed(chosen: dict[str, str]) -> None:
    with loading(options(**chosen), 0) as load:
        assert load.take() is None


def test_an_error_ends_one_that_nobody_took() -> None:
    with (
        tempfile.TemporaryFile() as lease,
        pytest.raises(ValueError, match="no such test"),
        loading(options(), lease.fileno()) as load,
    ):
        server = load.fork_server
        assert server is not None and server.is_alive
        raise ValueError("no such test")
    assert not server.is_alive


def test_it_stays_with_who_took_it() -> None:
    with tempfile.TemporaryFile() as lease:
        with loading(options(), lease.fileno()) as load:
            server = load.take()
        assert server is not None and server.is_alive
        server.kill()
    assert not server.is_alive
