"""From messages about compiled files to lines of the spec."""

import pytest

from tests.plan.plans import BASE


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("service camera has no image", 8),
        ('service "track-camera" has no image', 12),
        ("no such service: my-camera", None),
        ("cameras", None),
        ("driver exited", None),
    ],
)
def test_the_service_that_a_message_names(text: str, line: int | None) -> None:
    place = BASE.place_named_in(text)
    assert (place.line if place else None) == line
