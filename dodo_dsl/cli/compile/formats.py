"""Diagnostics as text and in the formats of other tools: SARIF 2.1.0, JUnit, GitLab's code quality."""

from collections.abc import Callable, Sequence
from itertools import groupby
from pathlib import Path
from typing import Any
from urllib.parse import quote

from dodo_dsl import __version__
from dodo_dsl.check import catalogue
from dodo_dsl.diagnostics import Diagnostic, fingerprints, format_gitlab, format_json, format_text, shown_path
from dodo_dsl.terminal import WIDE, json_text

_SARIF = "https://docs.oasis-open.org/sarif/sarif/v2.1.0/errata01/os/schemas/sarif-schema-2.1.0.json"


def format_sarif(diagnostics: Sequence[Diagnostic]) -> str:
    """A SARIF log, as code scanning and editors read it; columns count characters."""
    pages = catalogue.pages()
    rules = sorted({d.rule for d in diagnostics})
    marks = fingerprints(diagnostics)
    results = [_result(d, rules.index(d.rule), mark) for d, mark in zip(diagnostics, marks, strict=True)]
    driver = {"name": "DoDo", "version": __version__, "rules": [_rule(pages[rule]) for rule in rules]}
    run = {"tool": {"driver": driver}, "columnKind": "unicodeCodePoints", "results": results}
    return json_text({"$schema": _SARIF, "version": "2.1.0", "runs": [run]})


def _rule(page: catalogue.Page) -> dict[str, Any]:
    return {
        "id": page.name,
        "shortDescription": {"text": page.summary},
        "fullDescription": {"text": page.why},
    }


def _result(diagnostic: Diagnostic, index: int, fingerprint: str) -> dict[str, Any]:
    span = diagnostic.span
    region = {"startLine": span.line, "startColumn": span.column, "endColumn": span.column + max(1, span.length)}
    place = {"artifactLocation": {"uri": _uri(span.file)}, "region": region}
    return {
        "ruleId": diagnostic.rule,
        "ruleIndex": index,
        "level": diagnostic.severity,
        "message": {"text": _sentence(diagnostic)},
        "locations": [{"physicalLocation": place}],
        "partialFingerprints": {"dodo/v1": fingerprint},
    }


def _uri(file: str) -> str:
    """Relative to the working folder, or a file's whole address."""
    shown = shown_path(file)
    return Path(shown).as_uri() if Path(shown).is_absolute() else quote(shown)


def _sentence(diagnostic: Diagnostic) -> str:
    return diagnostic.sentence + (f" ({diagnostic.hint})" if diagnostic.hint else "")


def format_junit(diagnostics: Sequence[Diagnostic], files: Sequence[str] = ()) -> str:
    """A test case a file: it fails by its errors; warnings are its output. ``files`` are those that were checked."""
    from junitparser import Failure, JUnitXml, TestCase, TestSuite

    from dodo_dsl.report.junit import xml_text

    by_file = {file: list(found) for file, found in groupby(diagnostics, lambda d: d.span.file)}
    suite = TestSuite("dodo compile --check")
    for file in sorted({*files, *by_file}):
        name = xml_text(shown_path(file))
        case = TestCase(name, classname="dodo")
        case._elem.set("file", name)
        found = by_file.get(file, [])
        errors, warnings = ([d for d in found if d.severity == severity] for severity in ("error", "warning"))
        if errors:
            failure = Failure(xml_text(f"{errors[0].span.line}: {errors[0].sentence}"), errors[0].rule)
            failure.text = xml_text(format_text(errors, WIDE))
            case.result = [failure]
        if warnings:
            case.system_out = xml_text(format_text(warnings, WIDE))
        suite.add_testcase(case)
    document = JUnitXml("dodo")
    document.add_testsuite(suite)
    document.update_statistics()  # type: ignore[no-untyped-call]
    text: bytes = document.tostring()  # type: ignore[no-untyped-call]
    return text.decode() + "\n"


def rendered(style: str, diagnostics: Sequence[Diagnostic], files: Sequence[str]) -> str:
    """The diagnostics in a format of ``FORMATS``; ``files`` are the specs that were checked."""
    return format_junit(diagnostics, files) if style == "junit" else _OTHERS[style](diagnostics)


_OTHERS: dict[str, Callable[[Sequence[Diagnostic]], str]] = {
    "text": format_text,
    "json": format_json,
    "gitlab": format_gitlab,
    "sarif": format_sarif,
}
FORMATS = (*_OTHERS, "junit")
