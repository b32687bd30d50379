"""The data of a page: numbers packed, and all of it as one value in a script that cannot be anything else."""

import base64
import json
from typing import Any

import numpy as np

from dodo_dsl.terminal import printable

VARIABLE = "dodoTest"
MOST_TEXT = 2000
"""Characters of a text that are shown."""


def packed(values: Any) -> str:
    """Numbers as 32-bit floats, little endian, in base64; NaN for what is not a finite number."""
    numbers = np.asarray(values, np.float64)
    with np.errstate(over="ignore", invalid="ignore"):
        return base64.b64encode(numbers.astype("<f4").tobytes()).decode()


def shown(text: object, most: int = MOST_TEXT) -> str:
    """A text of others as one line that moves, turns and hides nothing, cut where it is too long."""
    line = str(text)
    more = f" … ({len(line)} characters)" if len(line) > most else ""
    return printable(line[:most]) + more


def script(document: Any) -> str:
    """A classic script that assigns a JSON value; only ASCII, and no character that begins a tag."""
    text = json.dumps(document, ensure_ascii=True, allow_nan=False, separators=(",", ":"))
    return f"var {VARIABLE} = " + text.replace("<", "\\u003c") + ";\n"
