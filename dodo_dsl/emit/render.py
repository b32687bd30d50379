"""Plans as the texts of files."""

import functools
from collections.abc import Iterator
from dataclasses import dataclass

import jinja2

from dodo_dsl import templates
from dodo_dsl.emit import compose, yaml
from dodo_dsl.plan.added_services import RECORDER
from dodo_dsl.plan.model import LAYERS, Plan
from dodo_dsl.plan.pipeline import SPARE_MINUTES, Pipeline
from dodo_dsl.plan.plan_json import json_text, to_json

CHILD = "child.gitlab-ci.yml"
PLAN_FILE = "test.json"


@dataclass(frozen=True)
class File:
    """A generated file; ``path`` is relative to the output folder."""

    path: str
    text: str


def render_plan(plan: Plan) -> list[File]:
    return [File(f"{plan.slug}/{name}", text) for name, text in _files(plan)]


def _files(plan: Plan) -> Iterator[tuple[str, str]]:
    names = [f"{layer}.compose.yml" for layer in LAYERS]
    for layer, name in zip(LAYERS, names, strict=True):
        is_own = layer == "application"
        document = plan.application.compose if is_own else compose.layer(plan, layer)
        about = {"first": LAYERS[0], "recorder": RECORDER, "report": compose.REPORT}
        yield name, _filled("layer.compose.yml.j2", plan=plan, layer=layer, document=document, **about)
    judges = [service.name for service in plan.services if service.judge]
    yield "compose.yaml", _filled("compose.yaml.j2", plan=plan, judges=judges, names=names)
    variables = {"PATH_SEPARATOR": ":", "FILE": ":".join(names), "PROJECT_NAME": f"dodo-{plan.slug}"}
    yield ".env", "".join(f"COMPOSE_{name}={value}\n" for name, value in variables.items())
    yield PLAN_FILE, to_json(plan)


def render_pipeline(child: Pipeline) -> File:
    return File(CHILD, _filled("child.gitlab-ci.yml.j2", pipeline=child, spare_minutes=SPARE_MINUTES))


def _filled(name: str, **values: object) -> str:
    return _templates().get_template(name).render(**values)


@functools.cache
def _templates() -> jinja2.Environment:
    environment = templates.environment(keep_trailing_newline=True)  # YAML: what authors write goes through filters
    environment.filters.update(yaml=json_text, plain=yaml.flow, compose=yaml.text)
    return environment
