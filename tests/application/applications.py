"""Applications from the text of a compose file."""

from pathlib import Path

from dodo_dsl.application.application_problems import application_problems
from dodo_dsl.application.model import ApplicationSource, ComposeService, declared, env_files, file_variables, plain
from dodo_dsl.diagnostics import Diagnostic, Span
from dodo_dsl.source import Mapping
from tests.source.nodes import mapping

FIRST = Span("docker-compose.yml")


def application(text: str, folder: Path = Path("/x"), dropped: dict[str, str] | None = None) -> ApplicationSource:
    """The application of a compose file that needs no merging."""
    document = mapping(text)
    entries = document.entries["services"].value
    assert isinstance(entries, Mapping)
    services = {}
    for name, entry in entries.entries.items():
        assert isinstance(entry.value, Mapping)
        files = tuple(env_files(entry.value))
        services[name] = ComposeService(
            name, entry.value, entry.key, declared(entry.value), files, file_variables(files, folder)
        )
    containers = {str(c): n for n, s in services.items() if (c := plain(s.node).get("container_name"))}
    rest = {key: entry.value for key, entry in document.entries.items() if key != "services"}
    return ApplicationSource(folder / "docker-compose.yml", services, rest, dropped or {}, containers)


def problems(text: str, folder: Path = Path("/x"), dropped: dict[str, str] | None = None) -> list[Diagnostic]:
    """Everything wrong with it."""
    return list(application_problems(application(text, folder, dropped), FIRST))
