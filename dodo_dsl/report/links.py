"""Links to the pages of tests from outside the report."""

import os
from collections.abc import Mapping, Sequence

from dodo_dsl.outcome import Outcome
from dodo_dsl.report.viewer import moment


def to_moments(outcomes: Sequence[Outcome], pages: Mapping[str, str], folder: str) -> dict[str, str]:
    """The page of each test at the moment that decided, where the verdict tells it.

    ``pages`` are paths in the report by slug, ``folder`` the report as seen from the working folder. In a job of GitLab
    that is the job's folder, and links lead to the job's artifacts.
    """
    job = os.environ.get("CI_JOB_URL", "")
    place = f"{job}/artifacts/file/{folder}" if job.startswith(("http://", "https://")) else folder
    return {o.slug: f"{place}/{pages[o.slug]}{_fragment(o)}" for o in outcomes if o.slug in pages}


def _fragment(outcome: Outcome) -> str:
    decisive = moment.decisive(outcome, 0.0)
    return "" if decisive.what == moment.END else f"#t={decisive.time:.2f}"
