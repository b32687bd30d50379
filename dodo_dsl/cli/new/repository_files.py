"""Files that a repository with tests needs: dodo.yml, schemas for editors, and those of ``dodo new --deployment``."""

from pathlib import Path

from dodo_dsl import __version__, package_data
from dodo_dsl.cli.new.new_file import New, filled
from dodo_dsl.spec.deployment.deployment import FILE_NAME

COMPOSE_FILES = ("docker-compose.yml", "docker-compose.yaml", "compose.yml", "compose.yaml")
REGISTRY = "tests"
_SCHEMAS = ".dodo"
_PROCESSES = {"python": "python, steering.py", "cpp": "build/steering"}
LANGUAGES = tuple(_PROCESSES)
"""Of the application that ``dodo new --application`` writes."""
PIPELINES = ("application", "deployment", "run")
"""The templates for GitLab, each of them a component in its folder."""
_SPEC_SCHEMA = "dodo.schema.json"


def compose_file(root: Path) -> str:
    """The name of the compose file in a folder, empty when there is none."""
    return next((name for name in COMPOSE_FILES if (root / name).is_file()), "")


def schema_of_specs(root: Path) -> Path:
    """Where editors find the schema of specs in a repository, whether it is there yet or not."""
    own = root / "schemas" / _SPEC_SCHEMA
    return own if own.is_file() else root / _SCHEMAS / _SPEC_SCHEMA


def missing_schemas(root: Path) -> list[New]:
    """The schemas for editors, as far as the repository lacks them."""
    return [] if schema_of_specs(root).is_file() else [file for file in _schemas(root) if not file.path.exists()]


def pipeline_template(name: str) -> bytes:
    """The text of one of ``PIPELINES``."""
    return (package_data.templates() / name / "template.yml").read_bytes()


def _schemas(root: Path) -> list[New]:
    paths = [package_data.schemas() / name for name in ("deployment.schema.json", _SPEC_SCHEMA)]
    return [New(root / _SCHEMAS / path.name, path.read_bytes()) for path in paths]


def dodo_yml(root: Path, application: str) -> New:
    """A dodo.yml; ``application`` is the name of its compose file, empty when there is none yet."""
    return New(root / FILE_NAME, filled("deployment/dodo.yml", application=application, registry=REGISTRY))


def application_files(root: Path, language: str) -> list[New]:
    """A small application that drives, and how it starts."""
    folder = f"application/{language}"
    values = {"base": f"dodo/vision:{__version__}"}
    templates = (package_data.templates() / "new" / folder).iterdir()
    sources = sorted(path.name for path in templates if path.is_file())  # an installed one has __pycache__ beside them
    compose = filled("application/docker-compose.yml", process=_PROCESSES[language])
    files = [New(root / name, filled(f"{folder}/{name}", **values)) for name in sources]
    return [*files, New(root / COMPOSE_FILES[0], compose)]


def included(images: bool) -> tuple[str, ...]:
    """The templates that a repository's pipeline includes to run its tests, and with ``images`` to build them first."""
    return ("deployment", "application") if images else ("deployment",)


def deployment_files(root: Path, *, images: bool = False) -> list[New]:
    """dodo.yml, the application's compose file if there is none, the pipeline with its templates, and schemas.

    With ``images`` the pipeline builds them, as the application has to be built.
    """
    application = compose_file(root) or COMPOSE_FILES[0]
    return [
        dodo_yml(root, application),
        New(root / application, filled("deployment/docker-compose.yml")),
        New(root / REGISTRY / "README.md", filled("deployment/tests.md")),
        New(root / ".gitlab-ci.yml", filled("deployment/gitlab-ci.yml", templates=included(images))),
        *(New(root / ".gitlab/dodo" / f"{name}.gitlab-ci.yml", pipeline_template(name)) for name in PIPELINES),
        *_schemas(root),
        New(root / ".gitignore", filled("deployment/gitignore", builds=images)),
    ]
