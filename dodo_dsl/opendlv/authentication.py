"""Proof that a message comes from who has the key of the test: an authentication code behind its payload.

DoDo's own messages end with a field ``bytes proof [id = 15]``: BLAKE2b with a key (RFC 7693), 16 bytes, over the
message's id and everything before the field. Imports the standard library alone.
"""

import hmac
from hashlib import blake2b

KEY_VARIABLE = "DODO_KEY"
"""Environment variable of DoDo's services: the key of their test in hexadecimal. Never set for an application."""

KEY_BYTES = 32
_PROOF_BYTES = 16
_FIELD = 15 << 3 | 2
_EMPTY = bytes([_FIELD, 0])
_TAG = bytes([_FIELD, _PROOF_BYTES])
_ADDED = len(_TAG) + _PROOF_BYTES


def with_proof(key: bytes, id_: int, payload: bytes) -> bytes:
    """The payload of a message, its last field filled with its proof; unchanged if there is no key."""
    signed = payload.removesuffix(_EMPTY)
    return signed + _TAG + _code(key, id_, signed) if key else payload


def is_proven(key: bytes, id_: int, payload: bytes) -> bool:
    """Whether a payload ends with its proof; without a key everything is believed."""
    if not key:
        return True
    signed, tag, code = payload[:-_ADDED], payload[-_ADDED:-_PROOF_BYTES], payload[-_PROOF_BYTES:]
    return tag == _TAG and hmac.compare_digest(code, _code(key, id_, signed))


def _code(key: bytes, id_: int, signed: bytes) -> bytes:
    code = blake2b(id_.to_bytes(4, "little"), digest_size=_PROOF_BYTES, key=key)
    code.update(signed)
    return code.digest()
