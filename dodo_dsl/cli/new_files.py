"""Files that ``dodo new`` writes into a repository with tests, or finds and keeps: dodo.yml, schemas, the pipeline.

Of a file that is kept it says what it lacks, and what in it meets DoDo's pipeline.
"""

import functools
import importlib.util
import re
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TextIO

import jinja2

from dodo_dsl import __version__, package_data, source
from dodo_dsl.application.read import as_written
from dodo_dsl.cli.existing_application import declarable, own_services
from dodo_dsl.diagnostics import shown_path
from dodo_dsl.opendlv import regular_file
from dodo_dsl.spec.deployment import FILE_NAME
from dodo_dsl.terminal import printable


@dataclass(frozen=True)
class New:
    """A file to write: its path and its content."""

    path: Path
    content: bytes


@functools.cache
def _templates() -> jinja2.Environment:
    return jinja2.Environment(
        loader=jinja2.FileSystemLoader(package_data.templates() / "new"),
        undefined=jinja2.StrictUndefined,
        autoescape=False,  # noqa: S701  (YAML and Markdown of names that are checked)
        keep_trailing_newline=True,
        trim_blocks=True,
    )


def filled(template: str, **values: object) -> bytes:
    return _templates().get_template(template).render(**values).encode()


COMPOSE_FILES = ("docker-compose.yml", "docker-compose.yaml", "compose.yml", "compose.yaml")
_SERVICES = re.compile(rb"^services:", re.MULTILINE)
_MOST_LOOKED, _MOST_NAMED, _MOST_BYTES = 200, 8, 20_000
REGISTRY = "tests"
_SCHEMAS = ".dodo"
_PROCESSES = {"python": "python, steering.py", "cpp": "build/steering"}
LANGUAGES = tuple(_PROCESSES)
ANSWERS = ("bus", "printed", "wheels")
"""Of the application that ``dodo new --application`` writes, as are its languages."""
_SPEC_SCHEMA = "dodo.schema.json"
_MESSAGES = "messages.odvd"
ROS = "ros"
"""How an application answers that is a ROS 2 node."""
ROS_PYTHON = ".ros/bin/python"
_OF_ROS = {
    "python": ("steering.py", "setup.py", "setup.cfg", "resource/steering"),
    "cpp": ("steering.cpp", "CMakeLists.txt"),
}
_PACKAGE_OF_ROS = ("package.xml", "Dockerfile", FILE_NAME, COMPOSE_FILES[0])
_RUN_COLCON = '"bash", "-c", ". install/setup.bash && exec install/steering/lib/steering/steering"'


def compose_file(root: Path) -> str:
    """The name of the compose file in a folder, empty when there is none."""
    return next((name for name in COMPOSE_FILES if (root / name).is_file()), "")


def own_compose_file(root: Path) -> str:
    """The same, also empty if nothing but the stack around an application is in it."""
    name = compose_file(root)
    application = as_written(root / name) if name else None
    return "" if application and not any(own_services(application)) else name


def other_compose_files(root: Path) -> list[str]:
    """Compose files under other names, in a repository and its folders, by their suffix and first keys."""
    found = sorted((*root.glob("*.y*ml"), *root.glob("[!.]*/*.y*ml")), key=lambda path: (len(path.parts), path))
    looked = (path for path in found[:_MOST_LOOKED] if path.is_file() and not path.is_symlink())
    names = [str(path.relative_to(root)) for path in looked if _SERVICES.search(_beginning(path))]
    return names[:_MOST_NAMED]


def _beginning(path: Path) -> bytes:
    try:
        with regular_file.opened(path) as file:
            return file.read(_MOST_BYTES)
    except OSError:
        return b""


def schema_of_specs(root: Path) -> Path:
    """Where editors find the schema of specs in a repository, whether it is there yet or not."""
    own = root / "schemas" / _SPEC_SCHEMA
    return own if own.is_file() else root / _SCHEMAS / _SPEC_SCHEMA


def missing_schemas(root: Path) -> list[New]:
    """The schemas for editors, as far as the repository lacks them."""
    return [] if schema_of_specs(root).is_file() else [file for file in _schemas(root) if not file.path.exists()]


def pipeline_template(name: str) -> bytes:
    """The text of one of ``package_data.PIPELINES``."""
    return (package_data.templates() / name / "template.yml").read_bytes()


def _schemas(root: Path) -> list[New]:
    paths = [
        package_data.schemas() / name for name in ("deployment.schema.json", "application.schema.json", _SPEC_SCHEMA)
    ]
    return [New(root / _SCHEMAS / path.name, path.read_bytes()) for path in paths]


def dodo_yml(root: Path, application: str) -> New:
    """A dodo.yml; ``application`` is the name of its compose file, empty when there is none yet."""
    declared = declarable(root / application) if (root / application).is_file() else None
    values = {"application": application, "registry": REGISTRY, "declared": declared}
    return New(root / FILE_NAME, filled("deployment/dodo.yml", **values))


def application_files(root: Path, language: str, answers: str) -> list[New]:
    """A small application that drives, and how it starts; what ``answers`` changes stands in a folder of that name."""
    if answers == ROS:
        process = f"{ros_python()}, steering.py" if language == "python" else _RUN_COLCON
        names = (*_OF_ROS[language], *_PACKAGE_OF_ROS)
        return [
            New(root / name, filled(f"application/ros/{name}", language=language, process=process)) for name in names
        ]
    values = {"base": f"dodo/vision:{__version__}", "process": _PROCESSES[language], "answers": answers}
    folder = package_data.templates() / "new/application"
    usual = [path for path in (folder / language).iterdir() if path.is_file()]  # an installed one has __pycache__
    sources = {path.name: f"{language}/{path.name}" for path in sorted(usual)}
    own = [*sources, FILE_NAME]
    sources |= {name: f"{answers}/{name}" for name in own if (folder / answers / name).is_file()}
    sources[COMPOSE_FILES[0]] = COMPOSE_FILES[0]
    if answers == "printed":
        sources.pop(_MESSAGES, None)
    return [New(root / name, filled(f"application/{place}", **values)) for name, place in sources.items()]


def ros_python() -> str:
    """The interpreter of a ROS 2 node: DoDo's own if it has ROS, else one that ``scripts/install-ros`` makes."""
    return "python" if importlib.util.find_spec("rclpy") else ROS_PYTHON


def include(images: bool, stage: str = "test") -> str:
    """The lines of a pipeline that include DoDo's jobs, which build images first where the application has to be."""
    inputs = f"{{stage: {stage}, images: true}}" if images else f"{{stage: {stage}}}"
    return f"include:\n  - local: .gitlab/dodo/tests.gitlab-ci.yml\n    inputs: {inputs}  # stage: one of yours\n"


def deployment_files(root: Path, *, images: bool = False, ros: bool = False) -> list[New]:
    """dodo.yml, the application's compose file if there is none, the pipeline with its templates, and schemas.

    With ``images`` the pipeline builds them, as the application has to be built.
    """
    application = compose_file(root) or COMPOSE_FILES[0]
    return [
        dodo_yml(root, application if own_compose_file(root) or not compose_file(root) else ""),
        New(root / application, filled("deployment/docker-compose.yml")),
        New(root / REGISTRY / "README.md", filled("deployment/tests.md")),
        New(root / ".gitlab-ci.yml", filled("deployment/gitlab-ci.yml", include=include(images))),
        *(
            New(root / ".gitlab/dodo" / f"{name}.gitlab-ci.yml", pipeline_template(name))
            for name in package_data.PIPELINES
        ),
        *_schemas(root),
        New(root / ".gitignore", filled("deployment/gitignore", builds=images, ros=ros)),
    ]


PIPELINE = ".gitlab-ci.yml"
IGNORED = ".gitignore"


def kept_pipeline(path: Path, images: bool) -> str:
    """What the user has to do so that a pipeline file that is kept has DoDo's jobs; empty where it has them.

    One that cannot be read has none, as GitLab will refuse it.
    """
    node, _ = source.read(path)
    root = node.entries if isinstance(node, source.Mapping) else {}
    if "include" in root and "dodo" in str(source.plain(root["include"].value)):
        return ""
    written = root["stages"].value if "stages" in root else None
    known = written.items if isinstance(written, source.Sequence) and not written.tag else ()
    stages = [printable(item.text) for item in known if isinstance(item, source.Scalar)]
    lines = include(images, "test" if "test" in stages or not stages else stages[0])
    return f"add to {PIPELINE}:\n\n{textwrap.indent(lines, '        ')}"


def missing_lines(file: New) -> list[str]:
    """The lines of a new file that the one in its place lacks; slashes around a path make no difference."""
    there = {line.strip().strip("/") for line in file.path.read_text(encoding="utf-8", errors="replace").splitlines()}
    return [line for line in file.content.decode().splitlines() if line.strip("/") not in there]


def write_new(files: Sequence[New], stdout: TextIO) -> None:
    """Writes new files, none of which may be there."""
    for file in files:
        file.path.parent.mkdir(parents=True, exist_ok=True)
        with file.path.open("xb") as stream:
            stream.write(file.content)
        stdout.write(f"wrote {shown_path(str(file.path))}\n")


def say_next(steps: Sequence[str], stdout: TextIO) -> None:
    """What the user may do now, one step a line."""
    stdout.write("\nnext: " + "\n      ".join(steps) + "\n")
