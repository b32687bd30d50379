"""Addresses of servers without their passwords."""

import pytest

from dodo_dsl.search.postgres import masked


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("postgresql://u:geheim@host/db", "postgresql://u:***@host/db"),
        ("postgres://u:ge@/:heim@host/db", "postgres://u:***@host/db"),
        ("'postgresql://u:ge heim@host/db' is", "'postgresql://u:***@host/db' is"),
        ("postgresql://:geheim@host", "postgresql://:***@host"),
        ("postgresql:/u:geheim@host", "postgresql:/u:***@host"),
        ("postgresql://u@host/db?password=geheim&x=1", "postgresql://u@host/db?password=***&x=1"),
        ("postgresql:///db?x=1&sslpassword=geheim", "postgresql:///db?x=1&sslpassword=***"),
        ("postgresql://u@host:5432/db", "postgresql://u@host:5432/db"),
        ("https://host:80/a@b", "https://host:80/a@b"),
    ],
)
def test_passwords_are_masked(text: str, shown: str) -> None:
    assert masked(text) == shown
