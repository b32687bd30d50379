"""What the jobs of the pipeline have in common: ``dodo compile --tags --image --run-options`` and their like."""

import argparse
import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

from dodo_dsl.cli.errors import UsageError, files_of_the_user
from dodo_dsl.cli.numbers import positive
from dodo_dsl.emit.pipeline_jobs import DEFAULT_TAGS, JobOptions
from dodo_dsl.opendlv import regular_file

_ACCESS = ("all", "developer", "none")
_NOTHING = ":"
"""The shell's command that does nothing, which a template has where no commands are given."""
_RUBY_TEXT = re.compile(r'"(?:[^"\\]|\\.)*"')
ARTIFACT, REPOSITORY = "artifact", "repository"
ARTIFACT_MB = 100
"""What an artifact may have by default in one's own GitLab."""
_IMAGE = re.compile(r"DODO_IMAGE_[A-Z0-9_]+=[A-Za-z0-9_.:/@-]+")


def add(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--tags", type=tags, default=DEFAULT_TAGS, metavar="TAGS",
                        help="tags of the runners of all jobs but those on rigs, separated by commas, or a JSON list; "
                        "'' for none (default: sil)")  # fmt: skip
    parser.add_argument("--image", default="", metavar="IMAGE",
                        help="image of all jobs but those on rigs (default: the runner's own)")  # fmt: skip
    parser.add_argument("--services", type=services, default=(), metavar="LIST",
                        help="services of all jobs but those on rigs, as a JSON list of what GitLab takes "
                        "(default: none)")  # fmt: skip
    parser.add_argument("--before-script", default="", metavar="COMMANDS",
                        help="first commands of all jobs but those on rigs (default: none)")  # fmt: skip
    parser.add_argument("--artifacts-access", choices=_ACCESS, default="all",
                        help="who may download the artifacts of jobs (default: all)")  # fmt: skip
    parser.add_argument("--run-options", default="", metavar="OPTIONS",
                        help="dodo run options of every test; the variable DODO_RUN_OPTIONS replaces them")  # fmt: skip
    parser.add_argument("--jobs", type=positive, metavar="N",
                        help="pack the tests into N jobs, evenly by their times or timeouts, and one a rig "
                        "(default: one a test)")  # fmt: skip
    parser.add_argument("--images", type=Path, metavar="FILE",
                        help="lines DODO_IMAGE_<SERVICE>=IMAGE of the application's images that were built: tests run "
                        "in containers of them")  # fmt: skip
    parser.add_argument("--files", choices=(ARTIFACT, REPOSITORY), default=ARTIFACT,
                        help="source of files of 1 MB and more in jobs: the artifact of this command's output, or "
                        "the repository, Git LFS included, which they check out (default: artifact)")  # fmt: skip
    parser.add_argument("--artifact-limit", type=positive, default=ARTIFACT_MB, metavar="MB",
                        help="warn when the files of all tests are larger (default: %(default)d, as GitLab's "
                        "own)")  # fmt: skip


def job_options(options: argparse.Namespace) -> JobOptions:
    """The options as ``add`` has them; raises UsageError for a file of images that is none."""
    images = _images(options.images) if options.images else ()
    texts = options.image.strip(), options.run_options.strip()
    before = options.before_script.strip()
    made = JobOptions(
        options.tags,
        *texts,
        images,
        options.jobs or 0,
        services=options.services,
        before_script="" if before == _NOTHING else before,
        artifacts_access="" if options.artifacts_access == "all" else options.artifacts_access,
        from_repository=options.files == REPOSITORY,
        artifact_mb=options.artifact_limit,
    )
    if not (options.jobs and options.times):
        return made
    from dodo_dsl.cli.forecast import known_seconds

    return replace(made, seconds=known_seconds(options.times))


def _images(path: Path) -> tuple[str, ...]:
    with files_of_the_user():
        lines = regular_file.text(path).splitlines()
    for number, line in enumerate(lines, 1):
        if not _IMAGE.fullmatch(line):
            raise UsageError(
                f"{path}:{number}: expected a line such as DODO_IMAGE_STEERING=registry.example.org/steering:1"
            )
    return tuple(lines)


def tags(text: str) -> tuple[str, ...]:
    """``sil,docker``, or the JSON list as which a GitLab variable holds an input of type array."""
    words = text.split(",")
    if text.strip().startswith("["):
        try:
            words = json.loads(text)
        except ValueError:
            raise argparse.ArgumentTypeError(
                f"'{text}' is not a list of tags, such as '[\"sil\"]' or 'sil,docker'"
            ) from None
    if not all(isinstance(word, str) for word in words):
        raise argparse.ArgumentTypeError(f"'{text}' contains something that is not a tag")
    return tuple(dict.fromkeys(word.strip() for word in words if word.strip()))


def services(text: str) -> tuple[str | dict[str, Any], ...]:
    """Services as a JSON list, or as Ruby writes one, which a GitLab variable holds for an input of type array."""
    try:
        found = json.loads(_as_json(text) or "[]")
    except ValueError:
        found = None
    if not isinstance(found, list) or not all(isinstance(one, str | dict) and one for one in found):
        raise argparse.ArgumentTypeError(
            f"'{text.strip()}' is not a list of services, such as '[\"docker:dind\"]'; a backslash is not allowed"
        )
    if unnamed := [one for one in found if isinstance(one, dict) and not isinstance(one.get("name"), str)]:
        raise argparse.ArgumentTypeError(f"the service {json.dumps(unnamed[0])} has no name")
    return tuple(found)


def _as_json(text: str) -> str:
    """``{:name=>"a"}`` and ``{name: "a"}`` as ``{"name": "a"}``; texts stay as they are, where Ruby escapes alike.

    A backslash may be one that GitLab took away before, so that no other than that of a quote is read.
    """
    parts, end = [], 0
    for found in _RUBY_TEXT.finditer(text):
        parts += [_keys(text[end : found.start()]), found[0].replace("\\#", "#")]
        end = found.end()
    made = "".join([*parts, _keys(text[end:])]).strip()
    return "?" if re.search(r'\\[^"]', made) else made


def _keys(between: str) -> str:
    """What is between texts, with its keys in quotes."""
    named = re.sub(r":(\w+)\s*=>|(\w+):(?=\s)", lambda key: f'"{key[1] or key[2]}":', between)
    return re.sub(r"\s*=>\s*", ": ", named).replace("nil", "null")
