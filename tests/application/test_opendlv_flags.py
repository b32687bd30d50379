"""Flags in commands: split as compose does, with a test's CID and memories."""

import pytest

from dodo_dsl.application import opendlv_flags


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("--cid=${CID:-${X:-3}} -v", "--cid=140 -v"),
        ('sh -c "p --cid=111;x --cid 5 && q --cid --verbose"', 'sh -c "p --cid=140;x --cid 140 && q --cid --verbose"'),
        ('--cid="111" a', "--cid=140 a"),
        (r"\"--cid=111\" --cid=\"111\"", r"\"--cid=140\" --cid=140"),
        ("--cid=$$(cat /cid) x", "--cid=140 x"),
        ("--cid-file=3 x--cid=4 --cidr=2", "--cid-file=3 x--cid=4 --cidr=2"),
        ("--cid= --verbose", "--cid=140 --verbose"),
        ("(prog --cid=$CID)", "(prog --cid=140)"),
    ],
)
def test_cid_in_strings(text: str, expected: str) -> None:
    assert opendlv_flags.with_cid_text(text, 140) == expected


def test_cid_and_memories_in_words() -> None:
    words = ("--cid", "111", "--cid=3", "--name=/video0.argb", "--name.i420=video0.i420", "--named=x", "cid=4")
    assert opendlv_flags.with_cid(words, 150) == ("--cid", "150", "--cid=150", *words[3:])
    assert opendlv_flags.with_memory_prefix(words, "p-")[3:] == (
        "--name=/p-video0.argb",
        "--name.i420=p-video0.i420",
        *words[5:],
    )
    shell = ("sh", "-c", "run --cid=111 --verbose")
    assert opendlv_flags.with_cid(shell, 150) == ("sh", "-c", "run --cid=150 --verbose")


@pytest.mark.parametrize(
    ("words", "variables", "expected"),
    [
        (["prog", "--cid=1"], {}, True),
        (["prog", "--cid", "1"], {}, True),
        (["sh", "-c", "prog $OD4SESSION_CID"], {}, True),
        (["prog"], {"CID": None}, True),
        (["prog", "--cidr=1"], {"ACID": "1"}, False),
    ],
)
def test_where_a_cid_can_be_set(words: list[str], variables: dict[str, object], expected: bool) -> None:
    assert opendlv_flags.takes_cid(words, variables) is expected


def test_where_a_memory_is_named() -> None:
    assert opendlv_flags.takes_memory(["prog", "--name.i420=video0.i420"])
    assert not opendlv_flags.takes_memory(["prog", "--name=", "--names=x"])


@pytest.mark.parametrize(
    ("process", "command", "left"),
    [
        ("build/steering", "/opt/steering --cid=111 steering", "--cid=111 steering"),
        ("python steering.py", "python3.11 /app/steering.py --cid=111", "--cid=111"),
        ("python3 -u -m app.steer", "python -m app.steer --fast", "--fast"),
        ("python steer.py", "./steer.py --cid=111", "--cid=111"),
        ("./drive --cid=111", "--cid=111 drive", "--cid=111 drive"),
        ("./drive", "run --cid=111", "run --cid=111"),
        ("./drive", "", ""),
    ],
)
def test_a_command_s_own_program_is_no_argument(process: str, command: str, left: str) -> None:
    assert opendlv_flags.arguments(process.split(), command.split()) == tuple(left.split())
