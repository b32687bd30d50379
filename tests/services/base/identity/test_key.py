"""The key of a test is taken out of what others can read."""

import subprocess
import sys

from dodo_dsl.opendlv.authentication import KEY_VARIABLE

PROGRAM = """
import os, pathlib
from services.base.members import take_key
before = pathlib.Path("/proc/self/environ").read_bytes()
print(take_key().hex(), os.environ.get("DODO_KEY"), b"c0ffee" in before)
print(b"c0ffee" in pathlib.Path("/proc/self/environ").read_bytes(), repr(take_key()))
"""


def test_nobody_finds_it_any_more() -> None:
    told = subprocess.run(
        [sys.executable, "-c", PROGRAM], env={KEY_VARIABLE: "c0ffee"}, capture_output=True, text=True, check=True
    )
    assert told.stdout.split() == ["c0ffee", "None", "True", "False", "b''"]
