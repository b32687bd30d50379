"""Log lines of all services by time."""

from pathlib import Path

import numpy as np
import pytest

from dodo_dsl.report.viewer import log_lines, recorded
from dodo_dsl.report.viewer.recorded import RecordedTest
from tests.report.viewer.drives import MESSAGES, WALL, MadeDrive, record

LOCKSTEP = RecordedTest((), 3.0, 1_000, np.array([5e9, 5e9 + 1e6]), np.array([0.0, 2.0]))
"""Two seconds of the test in one of the machine."""


def write(folder: Path, name: str, *lines: tuple[int, bytes]) -> None:
    offset, times = 0, ""
    for time, line in lines:
        times += f"{offset} {time}\n"
        offset += len(line)
    (folder / f"{name}.log").write_bytes(b"".join(line for _, line in lines))
    (folder / f"{name}.times").write_text(times)


def test_lines_of_services_are_merged_in_the_tests_time(tmp_path: Path) -> None:
    write(
        tmp_path, "application.a", (4_999_000_000, b"before\n"), (5_000_500_000, b"in\nit\n"), (5_009_000_000, b"end")
    )
    write(tmp_path, "evaluation.b", (5_000_250_000, b"ready\n"))
    (tmp_path / "action.c.log").write_text("untimed\n")
    log = log_lines.merged(tmp_path, LOCKSTEP)
    assert [(time, log["services"][service], text) for time, service, _, text in log["lines"]] == [
        (-1.0, "a", "before"),
        (0.5, "b", "ready"),
        (1.0, "a", "in"),
        (1.0, "a", "it"),
        (3.0, "a", "end"),
        (None, "c", "untimed"),
    ]


def test_in_real_time_both_clocks_are_one(tmp_path: Path) -> None:
    samples = [(n / 10, "opendlv.proxy.PedalPositionRequest", 0, {"position": 0.1}) for n in range(10)]
    made = MadeDrive("x", 1.0, samples, {})
    record(tmp_path / "test.rec", made, epoch=WALL, speed=1.0)
    test = recorded.read(tmp_path / "test.rec", MESSAGES)
    write(tmp_path, "application.a", *[(WALL + n, b"x\n") for n in (-500_000, 250_000, 750_000, 2_000_000)])
    assert [time for time, *_ in log_lines.merged(tmp_path, test)["lines"]] == [-0.5, 0.25, 0.75, 1.0]


@pytest.mark.parametrize("test", [RecordedTest(), RecordedTest(begin=1_700_000_000_000_000)], ids=["no", "lockstep"])
def test_without_a_clock_in_common_times_count_from_when_all_were_ready(tmp_path: Path, test: RecordedTest) -> None:
    write(tmp_path, "action.a", (WALL, b"ready\n"))
    write(tmp_path, "action.b", (WALL + 250_000, b"ready\n"), (WALL + 2_250_000, b"end\n"))
    write(tmp_path, "application.c", (WALL + 750_000, b"Traceback\n"))
    (tmp_path / "application.d.log").write_text("untimed\n")
    assert [time for time, *_ in log_lines.merged(tmp_path, test)["lines"]] == [-0.25, 0.0, 0.5, 2.0, None]


@pytest.mark.parametrize(
    ("text", "levels"),
    [
        ("Traceback (most recent call last):\n  File x\nKeyError: 1\non", ["error", "error", "error", ""]),
        ("ERROR no camera", ["error"]),
        ("clock: WARNING: late", ["warning"]),
        ("terminate called after throwing", ["error"]),
        ("no errors, distance error 0.1 m", [""]),
    ],
)
def test_errors_and_warnings_are_marked(tmp_path: Path, text: str, levels: list[str]) -> None:
    (tmp_path / "application.a.log").write_text(text)
    assert [line[2] for line in log_lines.merged(tmp_path, RecordedTest())["lines"]] == levels


def test_long_logs_keep_both_ends(tmp_path: Path) -> None:
    (tmp_path / "application.a.log").write_text("".join(f"{n}\n" for n in range(9000)))
    (tmp_path / "application.b.log").write_bytes(b"x" * 3_000_000 + b"\x1b[31mend\x1b[0m\n")
    log = log_lines.merged(tmp_path, RecordedTest())
    texts = [text for *_, text in log["lines"]]
    assert (len(texts), log["left"]) == (log_lines.MOST_LINES, 5002)
    assert (texts[0], texts[-3]) == ("0", "8999")
    assert texts[-1].endswith("xxx … (2400 characters)")
    assert max(map(len, texts)) < 700
