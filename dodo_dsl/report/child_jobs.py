"""The reports that jobs of GitLab's child pipelines keep as artifacts, fetched through its API.

Source: https://docs.gitlab.com/api/jobs/ and https://docs.gitlab.com/api/job_artifacts/
"""

import json
import shutil
import tempfile
import urllib.error
import urllib.request
import zipfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dodo_dsl.report.results import FILE_NAME, GivenReport, ResultsError, read_given

VARIABLE = "DODO_API_TOKEN"
"""The variable with a token of scope ``read_api``; without it the job's own is used."""
FOLDER = "dodo-report"
"""Of a job's report among its artifacts."""
_NEEDED = ("CI_API_V4_URL", "CI_PROJECT_ID", "CI_PIPELINE_ID")
_PATIENCE_S = 60.0
_MOST_BYTES = 16 << 30
"""Of a report, unpacked."""
_MOST_JSON = 16 << 20


class NoChildJobs(ValueError):
    """Why there are no reports of child pipelines; one sentence."""

    usage = True


@dataclass(frozen=True)
class ParentPipeline:
    """A pipeline of a project: ``url`` of the project in the API, and the header that authorises."""

    url: str
    number: str
    header: tuple[str, str]

    def json(self, path: str) -> Iterator[dict[str, Any]]:
        """The elements of a list, page by page; raises NoChildJobs."""
        page = "1"
        while page:
            with self.opened(f"{path}?per_page=100&page={page}") as response:
                yield from json.loads(response.read(_MOST_JSON))
                page = response.headers.get("x-next-page") or ""

    def opened(self, path: str) -> Any:
        """A response; the token goes to no other host. Raises NoChildJobs."""
        request = urllib.request.Request(f"{self.url}/{path}")  # noqa: S310  (of_job looks at its scheme)
        request.add_unredirected_header(*self.header)
        try:
            return urllib.request.urlopen(request, timeout=_PATIENCE_S)  # noqa: S310  (as above)
        except urllib.error.HTTPError as error:
            error.close()
            advice = f"; set {VARIABLE} to a token of scope read_api" if error.code in (401, 403, 404) else ""
            raise NoChildJobs(f"GitLab answers '{error.code} {error.reason}' to {path}{advice}") from None
        except OSError as error:
            raise NoChildJobs(f"GitLab cannot be reached at {self.url}: {error}") from None


def of_job(environment: Mapping[str, str]) -> ParentPipeline:
    """The pipeline of the job that this runs in; raises NoChildJobs."""
    own = environment.get(VARIABLE)
    for name in _NEEDED if own else (*_NEEDED, "CI_JOB_TOKEN"):
        if not environment.get(name):
            raise NoChildJobs(f"{name} is not set; --gitlab is for jobs of GitLab")
    api, project, number = (environment[name] for name in _NEEDED)
    if not api.startswith(("http://", "https://")):
        raise NoChildJobs(f"CI_API_V4_URL is '{api[:60]}', expected a URL")
    header = ("PRIVATE-TOKEN", own) if own else ("JOB-TOKEN", environment["CI_JOB_TOKEN"])
    return ParentPipeline(f"{api}/projects/{project}", number, header)


def fetch(pipeline: ParentPipeline, folder: Path) -> tuple[list[GivenReport], list[str]]:
    """The reports of the jobs of all child pipelines, kept in ``folder``, and sentences on those without a whole one.

    Raises NoChildJobs where GitLab does not list them.
    """
    try:
        children = [each.get("downstream_pipeline") for each in pipeline.json(f"pipelines/{pipeline.number}/bridges")]
        jobs = [job for child in children if child for job in pipeline.json(f"pipelines/{int(child['id'])}/jobs")]
        named = sorted((int(j["id"]), str(j["name"]), bool(j.get("artifacts_file")), str(j["status"])) for j in jobs)
    except NoChildJobs:
        raise
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise NoChildJobs("GitLab's answer lists no jobs") from error
    reports, sentences = list[GivenReport](), list[str]()
    for number, name, has_artifacts, status in named:
        place = folder / str(number)
        try:
            if has_artifacts:
                _fetch(pipeline, number, place)
            if (place / FOLDER).is_dir():
                reports.append(read_given(place / FOLDER))
            elif has_artifacts or status != "success":
                sentences.append(f"job '{name}' has no report")
        except (NoChildJobs, ResultsError) as problem:
            sentences.append(f"job '{name}' is left out: {str(problem).replace(f'{place}/', '')}")
    return reports, sentences


def _fetch(pipeline: ParentPipeline, number: int, folder: Path) -> None:
    """Writes the report among a job's artifacts; raises NoChildJobs.

    Extracted files are regular ones below ``folder``, whatever the archive names or calls a link.
    """
    with pipeline.opened(f"jobs/{number}/artifacts") as response, tempfile.TemporaryFile() as archive:
        try:
            shutil.copyfileobj(response, archive)
            with zipfile.ZipFile(archive) as opened:
                entries = [each for each in opened.infolist() if each.filename.startswith(f"{FOLDER}/")]
                is_small = sum(each.file_size for each in entries) <= _MOST_BYTES
                opened.extractall(folder, entries if is_small else [])
        except Exception as error:  # noqa: BLE001  (zipfile raises many kinds for damage and for what it does not know)
            said = f"its artifacts, job {number}, cannot be read ({str(error) or type(error).__name__})"
            raise NoChildJobs(f"{said}, expected a zip archive with {FOLDER}/{FILE_NAME}") from None
    if not is_small:
        raise NoChildJobs("the artifacts are larger than a report may be")
