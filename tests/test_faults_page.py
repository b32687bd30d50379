"""The page of faults has every fault and nothing else; that its rows are true, the tests of the faults show."""

from tests.faults import FAULTS, PAGE, read, section


def test_the_page_is_as_it_is_made() -> None:
    assert PAGE.read_text().endswith(section(read())), "scripts/make-faults brings it up to date"
    assert list(dict.fromkeys(row.fault for row in read())) == list(FAULTS)


def test_no_row_blames_the_application_for_what_it_did_not_do() -> None:
    innocent = [row for row in read() if row.outcome == "failed" and not row.sentence.startswith("application ")]
    assert innocent == []
