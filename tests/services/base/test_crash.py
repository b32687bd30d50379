"""Where the code of a repository's own service went wrong."""

from collections.abc import Callable
from pathlib import Path

from services.base import Check
from services.base.process import sentence, short_traceback


def raised(work: Callable[[], object]) -> Exception:
    try:
        work()
    except Exception as error:  # noqa: BLE001  (whatever the work raises)
        return error
    raise AssertionError("nothing was raised")


def test_the_innermost_place_of_its_own_code(tmp_path: Path) -> None:
    """Also in a neighbour that several services share, and not in a library below it."""
    shared, names = tmp_path / "my_services/shared.py", {}
    shared.parent.mkdir()
    shared.write_text("import json\n\ndef load(text):\n    return json.loads(text)\n")
    exec(compile(shared.read_text(), shared, "exec"), names)
    error = raised(lambda: names["load"]("["))
    place = "my_services/shared.py:4, in load"
    assert sentence(error, shared.parent / "judge").endswith(f"Expecting value: line 1 column 2 (char 1) ({place})")
    assert short_traceback(error, shared.parent / "judge") == (
        "Traceback without libraries (most recent call last):\n"
        '  File "my_services/shared.py", line 4, in load\n    return json.loads(text)'
    )


def test_what_the_base_cannot_use_is_shown_there(tmp_path: Path) -> None:
    error = raised(lambda: Check("step", 1.0, "deg").as_json())  # type: ignore[arg-type]
    told = sentence(error, tmp_path / "my_services/judge")
    assert told.startswith("AttributeError: 'str' object has no attribute 'items' (services/base/service.py:")
    assert told.endswith(", in as_json)")
