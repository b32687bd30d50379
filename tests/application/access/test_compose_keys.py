"""The page of compose's keys is up to date."""

from pathlib import Path

from tests.application.access import keys_page

PAGE = Path(__file__).parents[3] / "docs" / "reference" / "compose-keys.md"


def test_the_page_is_up_to_date(update_goldens: bool) -> None:
    if update_goldens:
        PAGE.write_text(keys_page.text())
    assert PAGE.read_text() == keys_page.text(), "make goldens brings it up to date"
