"""The address of a PostgreSQL server, postgresql://USER@HOST/DATABASE, without what it may hold of a password."""

import re

SCHEMES = ("postgresql://", "postgres://")
_PASSWORD = re.compile(r"(postgres(?:ql)?:/+[^/@:\s]*):.*@", re.DOTALL)
_PARAMETER = re.compile(r"([?&](?:ssl)?password=)[^&\s'\"]*")


def masked(text: str) -> str:
    """The text with ``***`` for each password of an address in it, also where it is written with wrong characters."""
    return _PARAMETER.sub(r"\1***", _PASSWORD.sub(r"\1:***@", text))
