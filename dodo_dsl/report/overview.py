"""``index.html``: the run at a glance, in one file: what failed comes first, and each row leads to its drive.

It shows everything without its script, which searches and filters.
"""

import base64
import hashlib
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from markupsafe import Markup

from dodo_dsl import __version__, package_data, templates
from dodo_dsl.outcome import Outcome
from dodo_dsl.report import checks
from dodo_dsl.report.comparison import KINDS, Comparison
from dodo_dsl.report.instances import check_of, families
from dodo_dsl.report.results import NO_CIRCUMSTANCES, Circumstances


class LinkedFiles(NamedTuple):
    """What a report has of a test: paths relative to its page, empty if there is none, and what each picture shows."""

    pictures: Sequence[tuple[str, str]] = ()
    logs: Sequence[str] = ()
    recording: str = ""
    spec: str = ""
    drive: str = ""


Past = Mapping[str, Sequence[tuple[str, str]]]
"""The latest runs by a test's slug, the latest last: each one's outcome, and a sentence on it."""
NO_PAST: Past = {}
_MOST_TEXT = 10_000
"""Characters of one text of others on the page."""
_MOST_OF_A_LINE = 56
"""Characters of the reason of a test that passed, which has one line."""


def render(
    outcomes: Sequence[Outcome],
    files: Mapping[str, LinkedFiles],
    comparison: Comparison | None = None,
    circumstances: Circumstances = NO_CIRCUMSTANCES,
    past: Past = NO_PAST,
) -> str:
    """The page, with files by slug; with a comparison, what changed since that report."""
    counts = {kind: sum(o.outcome == kind for o in outcomes) for kind in ("passed", "failed", "error")}
    template = templates.environment(autoescape=True, finalize=_harmless).get_template("report.html.j2")
    return template.render(
        outcomes=outcomes,
        families=sorted(families(outcomes), key=lambda family: family.urgency),
        files=files,
        past=past,
        checks=checks,
        check_of=check_of,
        longest=_MOST_OF_A_LINE,
        taken_s=sum((o.setup_s or 0.0) + (o.execution_s or 0.0) for o in outcomes),
        counts=counts,
        not_run=circumstances.not_run,
        runs=circumstances.runs,
        version=__version__,
        comparison=comparison,
        kinds=KINDS,
        script=_text("report/suite.js"),
        style=_text("viewer/tokens.css") + _text("report/suite.css"),
        hash=source_hash,
    )


def _text(template: str) -> str:
    return (package_data.templates() / template).read_text(encoding="utf-8")


def source_hash(text: str) -> str:
    """A script or style, as a Content-Security-Policy allows it alone (CSP level 3, section 2.3.1)."""
    return f"sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}"


def _harmless(value: Any) -> Any:
    """No control characters but line ends and tabs: they would command the terminal of who looks at the source.

    A long text is cut.
    """
    if not isinstance(value, str) or isinstance(value, Markup):
        return value
    text = value[:_MOST_TEXT]
    plain = text if text.isprintable() else "".join(c if c.isprintable() or c in "\n\t" else "\ufffd" for c in text)
    return plain if text == value else f"{plain} … ({len(value)} characters)"
