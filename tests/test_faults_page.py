"""The page of faults has every fault and nothing else; that its rows are true, the tests of the faults show."""

from tests.faults import FAULTS, PAGE, normal, page, read


def test_the_page_is_as_it_is_made() -> None:
    assert PAGE.read_text() == page(read()), "scripts/make-faults brings it up to date"


def test_every_fault_has_its_row() -> None:
    assert list(dict.fromkeys(row.fault for row in read())) == list(FAULTS)


def test_no_row_blames_the_application_for_what_it_did_not_do() -> None:
    innocent = [row for row in read() if row.outcome == "failed" and not row.sentence.startswith("application ")]
    assert innocent == []


def test_numbers_are_left_out() -> None:
    said = normal("no verdict within the timeout of 0.5 s; 127.0.0.1:4711 was killed after 12 s: 3 containers")
    assert said == "no verdict within the timeout of N s; 127.0.0.1:N was killed after N s: N containers"
