"""Where a new test goes: the repository around the working folder, or a new one in it."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from dodo_dsl import package_data
from dodo_dsl.cli.errors import UsageError
from dodo_dsl.cli.new.new_file import New
from dodo_dsl.cli.new.repository_files import COMPOSE_FILES, REGISTRY, compose_file, dodo_yml, missing_schemas
from dodo_dsl.compiler import Checked
from dodo_dsl.diagnostics import Diagnostic, format_text, shown_path
from dodo_dsl.spec.deployment.deployment import FILE_NAME, Deployment

_NO_APPLICATION = (
    f"write your application's compose file, and name it in {FILE_NAME}: application: {COMPOSE_FILES[0]}\n"
    "      (dodo new --application, in an empty folder, writes an application to begin with, and a test)"
)


@dataclass(frozen=True)
class Destination:
    """The repository's root, the registry that takes the test, and the files that the repository lacks for it.

    ``todo`` says what the user has to do before the test can run, empty where an application is named and there.
    """

    root: Path
    registry: Path
    files: tuple[New, ...]
    todo: str = ""


def destination(checked: Checked) -> Destination:
    """Raises UsageError where ``dodo.yml`` is wrong or names no folder of the repository."""
    deployment = checked.deployment
    root = deployment.root.resolve()
    schemas = missing_schemas(root)
    if deployment.file is None:
        application = compose_file(root)
        files = (dodo_yml(root, application), *schemas)
        return Destination(root, root / REGISTRY, files, "" if application else _NO_APPLICATION)
    todo = "" if deployment.application else _NO_APPLICATION
    return Destination(root, _registry(deployment, checked.diagnostics), tuple(schemas), todo)


def _registry(deployment: Deployment, diagnostics: Sequence[Diagnostic]) -> Path:
    """The first registry that belongs to the repository itself, and not to a DoDo that is installed in it.

    One that does not exist yet counts where there is no other.
    """
    own = [d for d in diagnostics if d.span.file == str(deployment.file) and d.severity == "error"]
    wrong = [d for d in own if d.rule != "missing-file"]
    if wrong:
        raise UsageError(f"{FILE_NAME} has problems:\n{format_text(wrong)}")
    root = deployment.root.resolve()
    for registry in (*deployment.registry, *deployment.absent):
        if registry.resolve().is_relative_to(root) and not package_data.is_shipped(registry, root):
            return registry
    file = shown_path(str(deployment.file))
    raise UsageError(f'{file} names no folder for own tests; write in it: registry: [{REGISTRY}, "dodo:"]')
