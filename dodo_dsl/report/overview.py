"""``index.html``: the run at a glance, in one file: what failed comes first, and each row leads to its drive.

It shows everything without its script, which searches and filters.
"""

import base64
import functools
import hashlib
import re
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import jinja2
from markupsafe import Markup, escape

from dodo_dsl import __version__, package_data
from dodo_dsl.outcome import MachineLoad, Outcome, Wait, megabytes
from dodo_dsl.report import checks
from dodo_dsl.report.comparison import KINDS, Comparison
from dodo_dsl.report.instances import check_of, families
from dodo_dsl.report.results import NO_CIRCUMSTANCES, Circumstances


def machine_line(load: MachineLoad) -> str:
    """What application and services waited, what others took, and how many pictures were late."""
    parts = []
    if load.application is None or load.services is None or load.others_share is None:
        parts.append("waits for a processor were not measured")
    else:
        parts += [_waited("the application", load.application, load), _waited("DoDo's services", load.services, load)]
        parts.append(f"others took {load.others_share * 100:.0f} % of {load.cores} cores")
    if load.late_pictures_share:
        parts.append(
            f"{load.late_pictures_share * 100:.0f} % of the pictures came late, by up to {load.lateness_s:.2f} s"
        )
    if load.paused_s:
        parts.append(f"the emulated rig stood still for {load.paused_s:.2f} s")
    return "; ".join(parts)


def _waited(who: str, wait: Wait, load: MachineLoad) -> str:
    longest = f" ({wait.longest})" if wait.longest else ""
    return f"{who} waited {wait.waited_s:.1f} s of {load.duration_s:.1f} s for a processor{longest}"


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
_BREAKS = re.compile(r"(?=\[)|(?<=,)")
_INDENT = re.compile(r"\n +(?=<)")
"""Of tags: text of others has none, and a page with many tests has thousands."""
_UNITS = re.compile(r"(?<=\d) (?=\S)")
_MOST_TEXT = 10_000
"""Characters of one text of others on the page."""
_MOST_REPOSITORIES = 4
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
    repositories = {r.commit: r for run in circumstances.runs for r in run.repositories}
    script = (package_data.templates() / "report" / "suite.js").read_text(encoding="utf-8")
    page = (
        environment()
        .get_template("report.html.j2")
        .render(
            outcomes=outcomes,
            families=sorted(families(outcomes), key=lambda family: family.urgency),
            files=files,
            past=past,
            checks=checks,
            check_of=check_of,
            longest=_MOST_OF_A_LINE,
            repositories=list(repositories.values())[:_MOST_REPOSITORIES],
            taken_s=sum((o.setup_s or 0.0) + (o.execution_s or 0.0) for o in outcomes),
            counts=counts,
            not_run=circumstances.not_run,
            runs=circumstances.runs,
            version=__version__,
            machine_line=machine_line,
            megabytes=megabytes,
            comparison=comparison,
            kinds=KINDS,
            script=script,
            style=style(),
            hash=source_hash,
            breakable=breakable,
            unbroken=unbroken,
        )
    )
    return _INDENT.sub("\n", page)


def style() -> str:
    """The style sheet of pages, which begins with what the drive viewer has in common with them."""
    parts = ("viewer/tokens.css", "report/suite.css")
    return "".join((package_data.templates() / part).read_text(encoding="utf-8") for part in parts)


@functools.cache
def environment() -> jinja2.Environment:
    """Renders pages of untrusted texts."""
    return jinja2.Environment(
        loader=jinja2.FileSystemLoader(package_data.templates()),
        undefined=jinja2.StrictUndefined,
        autoescape=True,
        finalize=_harmless,
    )


def breakable(name: str) -> Markup:
    """A test's name, which lines may break before its values and between them."""
    return Markup("<wbr>").join(_BREAKS.split(_harmless(name)))


def unbroken(text: str) -> Markup:
    """Values whose units stay in the line of their numbers."""
    return Markup(_UNITS.sub("\u00a0", escape(_harmless(text))))  # noqa: S704  (escaped)


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
