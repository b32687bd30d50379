"""Only who has the key makes a proof, and only of what it was made."""

from hypothesis import given
from hypothesis import strategies as st

from dodo_dsl.opendlv.authentication import is_proven, with_proof
from dodo_dsl.opendlv.message_set import MessageSet

KEYS = st.binary(min_size=1, max_size=64)
IDS = st.integers(1, 2**31 - 1)


@given(KEYS, IDS, st.binary(max_size=300))
def test_what_has_a_proof_is_believed(key: bytes, id_: int, payload: bytes) -> None:
    assert is_proven(key, id_, with_proof(key, id_, payload))


@given(KEYS, IDS, st.binary(max_size=60), st.data())
def test_a_changed_bit_another_key_or_id_is_not(key: bytes, id_: int, payload: bytes, data: st.DataObject) -> None:
    proven = with_proof(key, id_, payload)
    place = data.draw(st.integers(0, len(proven) * 8 - 1))
    changed = bytearray(proven)
    changed[place // 8] ^= 1 << place % 8
    assert not is_proven(key, id_, bytes(changed))
    assert not is_proven(key + b"1", id_, proven)
    assert not is_proven(key, id_ + 1, proven)
    assert not is_proven(key, id_, proven[:-1])


@given(st.binary(max_size=100))
def test_nothing_else_is(payload: bytes) -> None:
    assert not is_proven(b"key", 2902, payload)


def test_without_a_key_nothing_needs_a_proof() -> None:
    assert with_proof(b"", 2902, b"step") == b"step"
    assert is_proven(b"", 2902, b"step")


def test_the_proof_is_a_field_of_the_message() -> None:
    messages = MessageSet.standard()
    begin, id_ = messages.type("dodo.TestBegin")(seed=7, application="1,2"), messages.id("dodo.TestBegin")
    read = messages.decode(id_, with_proof(b"key", id_, messages.encode(begin)))
    assert (read.seed, read.application, len(read.proof)) == (7, "1,2", 16)  # type: ignore[attr-defined]
