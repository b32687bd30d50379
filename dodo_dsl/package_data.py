"""Paths of the package's data: schemas, templates, services and the shipped registry.

An installed wheel has them in ``dodo_dsl/_data``, a checkout beside the package.
"""

from pathlib import Path

_PACKAGE = Path(__file__).resolve().parent
INSTALLED = "lib*/python3*/*-packages/dodo_dsl/_data"
"""What ``root`` is of an installed wheel, below the folder of a Python. An editable install has a copy there, too."""

PIPELINES = ("tests", "run")
"""The templates for GitLab, each of them a component in its folder."""


def root() -> Path:
    bundled = _PACKAGE / "_data"
    return bundled if bundled.is_dir() else _PACKAGE.parent


def schemas() -> Path:
    return root() / "schemas"


def templates() -> Path:
    return root() / "templates"


def services() -> Path:
    return root() / "services"


def registry() -> Path:
    return root() / "tests_registry"


def checkout() -> Path | None:
    """The checkout that DoDo runs from; None for an installed wheel, and in DoDo's image."""
    return root() if is_checkout(root()) else None


def is_checkout(folder: Path) -> bool:
    return (folder / "dodo_dsl").is_dir() and (folder / "scripts" / "setup").is_file()


def is_shipped(folder: Path, repository: Path) -> bool:
    """Whether a folder of tests ships with DoDo and is used from another repository than DoDo's checkout."""
    return folder.resolve().is_relative_to(registry().resolve()) and repository.resolve() != root().resolve()
