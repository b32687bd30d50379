"""``python -m dodo_dsl`` and ``dodo``: the process's exit, its streams, and what begins before anything is loaded."""

import contextlib
import gc
import io
import os
import sys

CLOSED = 3


def run() -> None:
    if sys.stdout is None or sys.stderr is None:
        sys.exit(_refuse_closed())
    if sys.getfilesystemencoding() != "utf-8":
        _start_again_in_utf8()
    if "_ARGCOMPLETE" in os.environ:  # a shell asks how a command line may go on
        import argcomplete

        from dodo_dsl.cli.main import parser

        called = os.environ.get("COMP_LINE", "").split()[1:2]
        argcomplete.autocomplete(parser(called), always_complete_options=False)
    if sys.argv[1:2] == ["run"]:
        from dodo_dsl.cli.loading import begin

        begin(sys.argv[2:])
    if "OPENBLAS_NUM_THREADS" not in os.environ:  # numpy's threads look for work for a tenth of a second each
        os.putenv("OPENBLAS_NUM_THREADS", "1")  # for this process alone: what it starts gets what os.environ has
    if sys.argv[1:2] in (["compile"], ["list"], ["report"], ["run"]):
        gc.disable()  # what they read stays until the end; collecting garbage took up to a quarter of their time
    try:
        from dodo_dsl.cli.main import main

        if isinstance(sys.stdout, io.TextIOWrapper):
            sys.stdout.reconfigure(errors="replace")  # a terminal without a letter costs no test its verdict
        code = main(sys.argv[1:], sys.stdout, sys.stderr)
    except KeyboardInterrupt:
        code = 130
    gc.freeze()  # the interpreter's end would look at everything once more
    sys.exit(_flushed(code))


def _start_again_in_utf8() -> None:
    """Replaces this process by one in Python's UTF-8 mode (PEP 540), as all that it starts will be.

    Whatever the locale, names of files are bytes, and specs, messages and reports are UTF-8.
    """
    words = [sys.executable, "-X", "utf8", *sys.orig_argv[1:]]
    os.execve(sys.executable, words, {**os.environ, "PYTHONUTF8": "1"})  # noqa: S606  (the same program)


def _refuse_closed() -> int:
    """Says that a standard stream is closed, whose number the next file that is opened would get."""
    if sys.stderr is not None:
        sys.stderr.write("dodo: standard output is closed, redirect it to /dev/null instead\n")
    return CLOSED


def _flushed(code: int) -> int:
    """The exit code, another one where the rest of the output cannot be written."""
    try:
        sys.stdout.flush()
    except OSError as error:
        with contextlib.suppress(OSError):
            sys.stderr.write(f"dodo: the output cannot be written: {error.strerror}\n")
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return code or CLOSED
    return code


if __name__ == "__main__":
    run()
