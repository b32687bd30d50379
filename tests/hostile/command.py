"""``dodo`` as a function: its exit code, and all that it would print."""

from io import StringIO

from dodo_dsl.cli.main import main

STRANGER = 54_321
"""The number of a user who owns nothing on this machine."""


def dodo(*words: str) -> tuple[int, str]:
    stdout = StringIO()
    code = main(words, stdout, stdout)
    return code, stdout.getvalue()
