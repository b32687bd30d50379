"""Numbers from text as people and protocols write them: not as Python alone does, such as ``1_0`` or ``١``."""

import re

_WHOLE = re.compile(r"[0-9]{1,20}")
_SHOWN = 40


def number(text: str) -> float:
    """As ``float``, which may be infinite and no number; raises ValueError."""
    if "_" in text or not text.isascii():
        raise ValueError(f"'{text[:_SHOWN]}' is not a number")
    return float(text)


def whole(text: str) -> int:
    if not is_whole(text[1:] if text[:1] in ("-", "+") else text):
        raise ValueError(f"'{text[:_SHOWN]}' is not a whole number")
    return int(text)


def is_whole(text: str) -> bool:
    """Whether a text is nothing but digits, at most 20 of them."""
    return bool(_WHOLE.fullmatch(text))
