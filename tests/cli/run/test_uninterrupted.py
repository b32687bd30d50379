"""What lets a run reach its end: closed pipes and signals."""

import os
import resource
import signal

import pytest

from dodo_dsl.cli.uninterrupted import UninterruptedStream, more_descriptors, undisturbed


def test_a_reader_that_leaves_ends_nothing() -> None:
    reading, writing = os.pipe()
    with os.fdopen(writing, "w") as pipe:
        stream = UninterruptedStream(pipe)
        assert stream.write("heard\n") == 6
        stream.flush()
        assert os.read(reading, 100) == b"heard\n"
        os.close(reading)
        for _ in range(3):
            stream.write("unheard\n")
            stream.writelines(["more\n", "lines\n"])
            stream.flush()
        assert stream.fileno() == pipe.fileno(), "all else is the stream's own"


def test_signals_wait_until_results_are_written() -> None:
    """Also where these tests run in a shell's background, whose programs begin with Ctrl-C ignored."""

    def interrupted() -> None:
        os.kill(os.getpid(), signal.SIGINT)

    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with undisturbed():
            interrupted()
        with pytest.raises(KeyboardInterrupt):
            interrupted()
    finally:
        signal.signal(signal.SIGINT, before)


def test_as_many_descriptors_as_are_allowed() -> None:
    before = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (min(256, before[1]), before[1]))
    try:
        more_descriptors()
        assert resource.getrlimit(resource.RLIMIT_NOFILE) == (before[1], before[1])
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, before)
