"""Files of a report for GitLab: ``junit.xml`` and ``metrics.txt``, with links to the pages of tests.

In JUnit failed is a failure, error an error, the class name is the level. The metrics are OpenMetrics, which GitLab
compares between branches.
"""

import io
import json
import os
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from dodo_dsl.outcome import NotRun, Outcome, worst_margin
from dodo_dsl.report import checks
from dodo_dsl.report.overview import LinkedFiles
from dodo_dsl.report.results import Circumstances
from dodo_dsl.report.viewer import moment
from dodo_dsl.terminal import printable

# what XML 1.0 cannot hold (section 2.2), whatever a service printed
_NOT_XML = re.compile("[^\t\n\r\u0020-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
_ATTACHMENT = "[[ATTACHMENT|"
"""What GitLab takes a file by, wherever it stands in a test's output: text of others has another."""


def junit(
    outcomes: Sequence[Outcome], files: Mapping[str, LinkedFiles], folder: str, circumstances: Circumstances
) -> bytes:
    """``junit.xml``; ``folder`` is that of the report and its files, from the working folder.

    Tests that were not run are skipped ones; date and host are those of the run, if it is one alone.
    """
    from junitparser import JUnitXml, Skipped, TestSuite

    suite = TestSuite("dodo")
    if len(circumstances.runs) == 1:
        suite.timestamp = circumstances.runs[0].date.partition("+")[0]
        suite.hostname = xml_text(circumstances.runs[0].host)
    cases = [_case(outcome, files[outcome.slug], folder) for outcome in outcomes]
    for test in circumstances.not_run:
        cases.append(_named(test))
        cases[-1].result = [Skipped(xml_text(f"not run: {test.reason}"))]
    suite.add_testcases(cases)  # one by one, each is counted with all before it
    document = JUnitXml("dodo")
    document.add_testsuite(suite)
    document.update_statistics()  # type: ignore[no-untyped-call]
    document.write(content := io.BytesIO(), pretty=True)
    return content.getvalue()


def _named(test: Outcome | NotRun) -> Any:
    from junitparser import TestCase

    case = TestCase(xml_text(test.name), classname=test.level)
    case._elem.set("file", xml_text(test.spec))
    return case


def _case(outcome: Outcome, files: LinkedFiles, folder: str) -> Any:
    """A test; in a job of GitLab, where the working folder is the job's, links lead to the job's artifacts."""
    from junitparser import Error, Failure

    job, decisive = os.environ.get("CI_JOB_URL", ""), moment.decisive(outcome, 0.0)
    place = f"{job}/artifacts/file/{folder}" if job.startswith(("http://", "https://")) else folder
    at = "" if decisive.what == moment.END else f"#t={decisive.time:.2f}"

    case = _named(outcome)
    case.time = round(outcome.execution_s or 0.0, 3)
    if outcome.outcome != "passed":
        result = (Failure if outcome.outcome == "failed" else Error)(_plain(outcome.reason), outcome.outcome)
        replay = [f"replay: {place}/{files.drive}{at}"] if files.drive else []
        result.text = _plain("\n".join([outcome.reason, *replay, *outcome.last_lines]))
        case.result = [result]
    # GitLab shows the text of a failure in place of this, and takes the attachment from here
    lines = [_plain(line) for line in [*checks.lines(outcome), *(f"note: {note}" for note in outcome.notes)]]
    lines += [xml_text(f"{_ATTACHMENT}{folder}/{path}]]") for path, _ in files.pictures[:1]]
    if lines:
        case.system_out = "\n".join(lines)
    return case


def _plain(text: str) -> str:
    """Text of others without what GitLab would take for an attachment."""
    return xml_text(text).replace(_ATTACHMENT, "[ [ATTACHMENT|")


def xml_text(text: str) -> str:
    """The text without what XML cannot hold."""
    return _NOT_XML.sub("\ufffd", text)


_METRICS = {
    "dodo_setup_seconds": "Time until all services were ready",
    "dodo_execution_seconds": "Time from ready to the end",
    "dodo_passed": "1 when the test passed",
    "dodo_check_value": "Value of an evaluator's check",
    "dodo_check_margin": "Distance of the value to its limit",
    "dodo_worst_margin": "Least margin of the checks, -1 to 1",
    "dodo_processor_seconds": "Processor time",
    "dodo_peak_memory_bytes": "Most memory at any time",
}


def metrics_text(outcomes: Sequence[Outcome]) -> str:
    """``metrics.txt``: duration of set-up and execution, outcome, margins, checks' values, the application's use.

    All are labelled with the test. Source: the text format of OpenMetrics 1.0, in which a sample occurs once.
    """
    found: dict[str, dict[str, float]] = {name: {} for name in _METRICS}
    for outcome in outcomes:
        for name, value, labels in _samples(outcome):
            if value is not None:
                texts = (f"{key}={json.dumps(printable(labels[key]), ensure_ascii=False)}" for key in sorted(labels))
                found[name][",".join(texts)] = float(value)
    lines = list[str]()
    for name, samples in found.items():
        lines += [f"# HELP {name} {_METRICS[name]}", f"# TYPE {name} gauge"]
        lines += [f"{name}{{{labels}}} {value!r}" for labels, value in samples.items()]
    return "\n".join([*lines, "# EOF\n"])


def _samples(outcome: Outcome) -> Iterator[tuple[str, float | None, dict[str, str]]]:
    """Names, values and labels of what an outcome has; None where it has nothing."""
    test = {"test": outcome.slug}
    yield "dodo_passed", outcome.outcome == "passed", test
    for name, seconds in (("setup", outcome.setup_s), ("execution", outcome.execution_s)):
        yield f"dodo_{name}_seconds", None if seconds is None else round(seconds, 3), test
    yield "dodo_worst_margin", worst_margin(outcome), test
    for use in outcome.resources:
        labels = {**test, "service": use.service}
        yield "dodo_processor_seconds", round(use.processor_s, 3), labels
        yield "dodo_peak_memory_bytes", use.peak_memory_bytes, labels
    for check in outcome.checks:
        labels = {**test, "check": check["name"], "unit": check.get("unit") or ""}
        yield "dodo_check_value", check["value"], labels
        yield "dodo_check_margin", check.get("margin"), labels
