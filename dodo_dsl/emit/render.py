"""Plans as the texts of files."""

import functools
from collections.abc import Iterator
from dataclasses import dataclass

import jinja2

from dodo_dsl import package_data
from dodo_dsl.emit import compose, yaml
from dodo_dsl.plan.added_services import RECORDER
from dodo_dsl.plan.model import LAYERS, Plan
from dodo_dsl.plan.pipeline import SPARE_MINUTES, Pipeline
from dodo_dsl.plan.plan_json import json_text, to_json

CHILD = "child.gitlab-ci.yml"
PLAN_FILE = "test.json"
_CHANGED = "Written by dodo compile; changes here are lost."
_NOTES = f"""\
# 'sandbox' holds the shared memory of all services. DODO_SUBNET is another subnet where this one is taken.
# Services wait for those of the layers before them, and are ready when their link is in dodo-channel.
# docker compose cp {RECORDER}:{compose.REPORT} . gets the recording.
"""


@dataclass(frozen=True)
class File:
    """A generated file; ``path`` is relative to the output folder."""

    path: str
    text: str


def render_plan(plan: Plan) -> list[File]:
    """The compose layers, ``compose.yaml`` and ``.env`` that name them, and ``test.json`` of one test."""
    return [File(f"{plan.slug}/{name}", text) for name, text in _files(plan)]


def _files(plan: Plan) -> Iterator[tuple[str, str]]:
    names = [f"{layer}.compose.yml" for layer in LAYERS]
    for layer, name in zip(LAYERS, names, strict=True):
        head = f"# Layer {layer} of test {plan.slug}: {plan.spec}\n# {_CHANGED}"
        if layer == "application":
            changes = "".join(f"#   {change}\n" for change in plan.application.changes)
            content = yaml.text(compose.application(plan.application.compose))
            yield name, f"{head} Made of the application's compose file:\n{changes}{content}"
        else:
            notes = _NOTES if layer == LAYERS[0] else ""
            yield name, f"{head}\n{notes}{yaml.text(compose.layer(plan, layer))}"
    judges = [service.name for service in plan.services if service.judge]
    only = f" --exit-code-from {judges[0]}" if len(judges) == 1 else ""
    listed = "".join(f"      - {name}\n" for name in names)
    yield (
        "compose.yaml",
        f"# Test {plan.slug}: {plan.spec}\n# {_CHANGED}\n#\n"
        f"#   docker compose up{only}\n"
        f"#       runs the test; the verdict is a line of JSON of {', '.join(judges)}\n"
        "#   docker compose down --volumes\n#       removes it\n"
        f"name: dodo-{plan.slug}\ninclude:\n  - path:\n{listed}",
    )
    variables = {"PATH_SEPARATOR": ":", "FILE": ":".join(names), "PROJECT_NAME": f"dodo-{plan.slug}"}
    yield ".env", "".join(f"COMPOSE_{name}={value}\n" for name, value in variables.items())
    yield PLAN_FILE, to_json(plan)


def render_pipeline(child: Pipeline) -> File:
    template = _templates().get_template("child.gitlab-ci.yml.j2")
    return File(CHILD, template.render(pipeline=child, spare_minutes=SPARE_MINUTES))


@functools.cache
def _templates() -> jinja2.Environment:
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(package_data.templates()),
        undefined=jinja2.StrictUndefined,
        autoescape=False,  # noqa: S701  (YAML, every value of an author goes through a filter)
        keep_trailing_newline=True,
    )
    environment.filters.update(yaml=json_text, plain=yaml.flow)
    return environment
