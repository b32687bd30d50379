"""OpenDLV flags in an application's command and environment: which CID and which memories it was told to use."""

import re
from collections.abc import Callable, Mapping, Sequence

CID_VARIABLES = ("CID", "OD4SESSION_CID")

_CID = re.compile(r"(?P<flag>--cid=)[^\s]*")
_MEMORY = re.compile(r"(?P<flag>--name(?:\.[A-Za-z0-9]+)?=)(?P<name>.+)", re.DOTALL)


def _map_flag(argv: Sequence[str], flag: str, change: Callable[[str], str]) -> tuple[str, ...]:
    """``--flag value`` in two words."""
    return tuple(change(word) if i and argv[i - 1] == flag else word for i, word in enumerate(argv))


def takes_cid(argv: Sequence[str], environment: Mapping[str, object]) -> bool:
    return any(_CID.match(w) or w == "--cid" for w in argv) or any(v in environment for v in CID_VARIABLES)


def takes_memory(argv: Sequence[str]) -> bool:
    return any(_MEMORY.match(word) for word in argv)


def with_cid(argv: Sequence[str], cid: int) -> tuple[str, ...]:
    """The command with ``--cid=N`` (and ``--cid N``) set."""
    replaced = [_CID.sub(rf"\g<flag>{cid}", word) for word in argv]
    return _map_flag(replaced, "--cid", lambda _: str(cid))


def with_memory_prefix(argv: Sequence[str], prefix: str) -> tuple[str, ...]:
    """The command with every ``--name=X`` and ``--name.kind=X`` naming ``<prefix>X``; a leading slash stays."""

    def prefixed(match: re.Match[str]) -> str:
        return match["flag"] + memory_name(match["name"], prefix)

    return tuple(_MEMORY.sub(prefixed, word) if _MEMORY.match(word) else word for word in argv)


def memory_name(name: str, prefix: str) -> str:
    return f"/{prefix}{name[1:]}" if name.startswith("/") else prefix + name
