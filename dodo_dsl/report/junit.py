"""``junit.xml`` as GitLab reads it: failed is a failure, error an error, the class name is the level."""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from dodo_dsl.outcome import NotRun, Outcome
from dodo_dsl.report import check_words
from dodo_dsl.report.run_record import RunRecord

# what XML 1.0 cannot hold (section 2.2), whatever a service printed
_NOT_XML = re.compile("[^\t\n\r\u0020-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
_ATTACHMENT = "[[ATTACHMENT|"
"""What GitLab takes a file by, wherever it stands in a test's output: text of others has another."""


def write(
    path: Path,
    outcomes: Sequence[Outcome],
    attachments: Mapping[str, str],
    links: Mapping[str, str],
    not_run: Sequence[NotRun] = (),
    runs: Sequence[RunRecord] = (),
) -> None:
    """Writes the file; ``attachments`` and ``links`` are pictures and pages by slug, from the working folder.

    Tests that were ``not_run`` are skipped ones; date and host are those of the run, if it is one of ``runs`` alone.
    """
    from junitparser import JUnitXml, TestSuite

    suite = TestSuite("dodo")
    if len(runs) == 1:
        suite.timestamp = runs[0].date.partition("+")[0]
        suite.hostname = xml_text(runs[0].host)
    for outcome in outcomes:
        suite.add_testcase(_case(outcome, attachments.get(outcome.slug), links.get(outcome.slug)))
    for test in not_run:
        suite.add_testcase(_skipped(test))
    document = JUnitXml("dodo")
    document.add_testsuite(suite)
    document.update_statistics()  # type: ignore[no-untyped-call]
    document.write(str(path), pretty=True)


def _case(outcome: Outcome, attachment: str | None, link: str | None) -> Any:
    from junitparser import Error, Failure, TestCase

    case = TestCase(xml_text(outcome.name), classname=outcome.level, time=round(outcome.execution_s or 0.0, 3))
    case._elem.set("file", xml_text(outcome.spec))
    if outcome.outcome != "passed":
        kind = Failure if outcome.outcome == "failed" else Error
        result = kind(_plain(outcome.reason), outcome.outcome)
        replay = [f"replay: {link}"] if link else []
        result.text = _plain("\n".join([outcome.reason, *replay, *outcome.last_lines]))
        case.result = [result]
    # GitLab shows the text of a failure in place of this, and takes the attachment from here
    said = [check_words.line(check, outcome.checks) for check in outcome.checks] + [
        f"note: {note}" for note in outcome.notes
    ]
    lines = [_plain(line) for line in said]
    if attachment:
        lines.append(f"{_ATTACHMENT}{attachment}]]")
    if lines:
        case.system_out = xml_text("\n".join(lines))
    return case


def _skipped(test: NotRun) -> Any:
    from junitparser import Skipped, TestCase

    case = TestCase(xml_text(test.name), classname=test.level)
    case._elem.set("file", xml_text(test.spec))
    case.result = [Skipped(xml_text(f"not run: {test.reason}"))]
    return case


def _plain(text: str) -> str:
    """Text of others without what GitLab would take for an attachment."""
    return xml_text(text).replace(_ATTACHMENT, "[ [ATTACHMENT|")


def xml_text(text: str) -> str:
    """The text without what XML cannot hold."""
    return _NOT_XML.sub("\ufffd", text)
