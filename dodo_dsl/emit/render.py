"""Plans through the Jinja templates."""

import functools
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

import jinja2
import yaml

from dodo_dsl import package_data
from dodo_dsl.application.interpolation import dotenv_line
from dodo_dsl.application.model import FILES
from dodo_dsl.emit.containers import containers, copy_command
from dodo_dsl.emit.pipeline import CHILD, SearchJobs, pipeline
from dodo_dsl.emit.pipeline_jobs import NO_OPTIONS, JobOptions
from dodo_dsl.plan.model import LAYERS, Plan, Suite
from dodo_dsl.plan.plan_json import json_text, to_json
from dodo_dsl.source import resolve
from dodo_dsl.template_cache import compiled_templates

_SERVICE_DEPTH = 2
_MOST_BLOCKS = 10_000
_OLD_BREAKS = "\x85\u2028\u2029"
_BLOCKS: dict[str, str] = {}


@dataclass(frozen=True)
class File:
    """A generated file; ``path`` is relative to the output folder."""

    path: str
    text: str


class _Dumper(yaml.SafeDumper):
    """Block style, two spaces, lists indented, no aliases: as usual in compose files."""

    def increase_indent(self, flow: bool = False, indentless: bool = False) -> None:
        super().increase_indent(flow, False)

    def ignore_aliases(self, data: Any) -> bool:
        return True


def _text(dumper: _Dumper, value: str) -> yaml.ScalarNode:
    """A string, quoted where YAML 1.2 would read another type, escaped where YAML 1.1 would break a line."""
    style = '"' if any(break_ in value for break_ in _OLD_BREAKS) else None if isinstance(resolve(value), str) else "'"
    return dumper.represent_scalar("tag:yaml.org,2002:str", value, style)


_Dumper.add_representer(str, _text)


def _yaml_block(value: dict[str, Any], depth: int = 0) -> str:
    """A compose file in block style. Tests of one application share most of it, so deep blocks are cached."""
    parts = []
    for key, below in value.items():
        if isinstance(below, dict) and below and depth < _SERVICE_DEPTH:
            head = _dumped({key: None}).removesuffix(" null")
            parts.append(f"{head}\n{textwrap.indent(_yaml_block(below, depth + 1), '  ')}")
        else:
            parts.append(_dumped({key: below}))
    return "\n".join(parts)


def _dumped(value: dict[str, Any]) -> str:
    key = repr(value)
    if key not in _BLOCKS:
        if len(_BLOCKS) >= _MOST_BLOCKS:
            _BLOCKS.clear()
        text: str = yaml.dump(value, Dumper=_Dumper, sort_keys=False, allow_unicode=True, width=1000)
        _BLOCKS[key] = text.rstrip("\n")
    return _BLOCKS[key]


def _yaml(value: Any) -> str:
    """A scalar as JSON, which YAML reads as the same value."""
    return json_text(value)


@functools.cache
def _templates() -> jinja2.Environment:
    environment = jinja2.Environment(
        bytecode_cache=compiled_templates(),
        loader=jinja2.FileSystemLoader(package_data.templates()),
        undefined=jinja2.StrictUndefined,
        autoescape=False,  # noqa: S701  (YAML, every value goes through the filter yaml)
        keep_trailing_newline=True,
    )
    environment.filters.update(yaml=_yaml, yaml_block=_yaml_block, dotenv=dotenv_line)
    return environment


def _render(template: str, **values: object) -> str:
    return _templates().get_template(template).render(**values)


def render_plan(plan: Plan) -> list[File]:
    """The compose layers, ``compose.yaml`` (which ends compose's search), ``.env`` and ``test.json`` of one test."""
    names = {layer: f"{layer}.compose.yml" for layer in LAYERS}
    own_network = plan.isolation == "network"
    files = [
        File(
            f"{plan.slug}/{names[layer]}",
            _render(
                "layer.compose.yml.j2",
                plan=plan,
                layer=layer,
                services=containers(plan, layer),
                own_network=own_network,
                sandbox=own_network and layer == LAYERS[0],
                copies=plan.application.copies if layer == LAYERS[0] else {},
                files_service=FILES,
                copy_command=copy_command(plan.application),
            ),
        )
        for layer in LAYERS
        if layer != "application"
    ]
    files.append(File(f"{plan.slug}/{names['application']}", _render("application.compose.yml.j2", plan=plan)))
    files.append(File(f"{plan.slug}/compose.yaml", _render("compose.yaml.j2")))
    files.append(File(f"{plan.slug}/.env", _render("env.j2", plan=plan, files=list(names.values()))))
    files.append(File(f"{plan.slug}/test.json", to_json(plan)))
    return files


def render_pipeline(
    suite: Suite,
    folder: str,
    searches: Sequence[SearchJobs] = (),
    options: JobOptions = NO_OPTIONS,
) -> File:
    """The child pipeline; ``folder`` is the output folder's name, as the parent's artifact has it."""
    child = pipeline(suite, folder, searches, options)
    parts = {field.name: getattr(child, field.name) for field in fields(child)}
    return File(CHILD, _render("child.gitlab-ci.yml.j2", **parts))


def render(suite: Suite, folder: str) -> list[File]:
    """Every generated file of a compilation, the pipeline first."""
    return [render_pipeline(suite, folder), *(file for plan in suite.plans for file in render_plan(plan))]
