"""The page of the components for GitLab's catalog, made of what their templates specify."""

import json
from pathlib import Path
from typing import Any

import yaml

from dodo_dsl import __version__

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "reference" / "components.md"
ABOUT = {
    "run": "One job that runs the tests of a repository, as many at once as the runner's cores allow.",
    "tests": "Compiles the tests of a repository, and runs each in a job of a child pipeline, also on rigs.",
}
HEAD = """# Components

The components of this repository for [GitLab's CI/CD catalog](../how-to/catalog.md), and their inputs, all of which are
optional. [GitLab](../how-to/gitlab.md) says what they do. `scripts/make-components` writes this page from `templates/`.
"""


def template(name: str) -> Path:
    return ROOT / "templates" / name / "template.yml"


def text() -> str:
    return HEAD + "".join(section(name, about) for name, about in ABOUT.items())


def section(name: str, about: str) -> str:
    """What a component does, how it is included, and a row for each input."""
    header = next(yaml.safe_load_all(template(name).read_text()))
    rows = "".join(row(key, spec) for key, spec in header["spec"]["inputs"].items())
    example = f"include:\n  - component: $CI_SERVER_FQDN/group/dodo/{name}@{__version__}\n    inputs: {{stage: test}}\n"
    table = f"| input | type | default | values | says |\n|---|---|---|---|---|\n{rows}"
    return f"\n## {name}\n\n{about}\n\n```yaml\n{example}```\n\n{table}"


def row(name: str, spec: dict[str, Any]) -> str:
    default = spec["default"]
    shown = f"`{default if isinstance(default, str) else json.dumps(default)}`" if default != "" else "none"
    allowed = ", ".join(f"`{value}`" for value in spec.get("options", ())) or _code(spec.get("regex", ""))
    cells = f"`{name}`", spec.get("type", "string"), shown, allowed, spec["description"]
    return f"| {' | '.join(cell.replace('|', chr(92) + '|').strip() for cell in cells)} |\n"


def _code(text: str) -> str:
    """A regular expression as code, which may hold backticks."""
    return f"`` {text} ``" if "`" in text else f"`{text}`" if text else "any"
