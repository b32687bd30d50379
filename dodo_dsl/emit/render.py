"""Plans through the Jinja templates."""

import functools
import re
import textwrap
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields
from typing import Any

import jinja2
import yaml

from dodo_dsl import package_data
from dodo_dsl.application.model import FILES
from dodo_dsl.emit.containers import CHANNEL, NO_DEFAULTS, READY_TRIES, Defaults, Variable, containers, copy_command
from dodo_dsl.emit.pipeline import CHILD, Pipeline
from dodo_dsl.emit.pipeline_jobs import SPARE_MINUTES
from dodo_dsl.plan.added_services import RECORDER, TIME, TIME_MOUNT, agent_flags
from dodo_dsl.plan.model import LAYERS, Plan
from dodo_dsl.plan.plan_json import json_text, to_json
from dodo_dsl.source import resolve
from dodo_dsl.template_cache import compiled_templates

_SERVICE_DEPTH = 2
_MOST_BLOCKS = 10_000
_OLD_BREAKS = "\x85\u2028\u2029"
_BLOCKS: dict[str, str] = {}
_PLAIN = re.compile(r"(?:[A-Za-z/]|--|\.{1,2}/)(?:[A-Za-z0-9_./=,@+$-]|:(?=[^ ])| (?=[^ ]))*(?<![: ])")
_WORDS = ("true", "false", "yes", "no", "on", "off", "y", "n", "null")
"""What YAML 1.1 takes for something else than a string."""


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


_SHARED = (
    "ipc", "network_mode", "pids_limit", "mem_limit", "ulimits", "cap_drop", "security_opt", "logging", "depends_on"
)  # fmt: skip
"""Keys of services that mostly have one value, as the test sets it."""


def _application(compose: dict[str, Any]) -> str:
    """The application's copy in block style; what several services share stands once."""
    services = compose.get("services") or {}
    blocks = {name: {k: _dumped({k: v}) for k, v in each.items()} for name, each in services.items()}
    first, *others = blocks.values() or [{}]
    shared = {k: first[k] for k in _SHARED if others and k in first and all(o.get(k) == first[k] for o in others)}
    if not shared:
        return _yaml_block(compose)
    parts = [
        "# What all services share; 'sandbox' in dodo.yml sets the limits.",
        f"x-shared: &shared\n{_indented(shared.values(), 2)}\n\nservices:",
    ]
    for name, block in blocks.items():
        head = _dumped({name: None}).removesuffix(" null")
        parts += [f"  {head}", _indented(["<<: *shared", *(block[key] for key in block if key not in shared)], 4)]
    rest = {key: value for key, value in compose.items() if key != "services"}
    return "\n".join([*parts, *([_yaml_block(rest)] if rest else [])])


def _indented(blocks: Iterable[str], spaces: int) -> str:
    return textwrap.indent("\n".join(blocks), " " * spaces)


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


def _plain(value: Any) -> str:
    """A string or a mapping of them on one line, without quotes where every reader of YAML takes it for the same."""
    if isinstance(value, Mapping):
        return f"{{{', '.join(f'{key}: {_within(each)}' for key, each in value.items())}}}"
    return _word(value) if isinstance(value, str) else json_text(value)


@functools.lru_cache(maxsize=_MOST_BLOCKS)
def _word(text: str) -> str:
    return text if _PLAIN.fullmatch(text) and text.lower() not in _WORDS else json_text(text)


@functools.lru_cache(maxsize=_MOST_BLOCKS)
def _variables(variables: tuple[Variable, ...], spaces: int) -> str:
    """Environment variables, each below what it is for; a list of words that is long has a line for each."""
    lines = []
    for variable in variables:
        lines += [f"# {variable.note}"] if variable.note else []
        words = variable.lines
        lines += [f"{variable.name}: >-", *(f"  {word}" for word in words)] if words else []
        lines += [] if words else [f"{variable.name}: {_word(variable.value)}"]
    return _indented(lines, spaces)


def _within(value: Any) -> str:
    """A value between braces, where commas and colons say something."""
    return _yaml(value) if isinstance(value, str) and ("," in value or ":" in value) else _plain(value)


@functools.cache
def _templates() -> jinja2.Environment:
    environment = jinja2.Environment(
        bytecode_cache=compiled_templates(),
        loader=jinja2.FileSystemLoader(package_data.templates()),
        undefined=jinja2.StrictUndefined,
        autoescape=False,  # noqa: S701  (YAML, every value goes through the filter yaml)
        keep_trailing_newline=True,
    )
    environment.filters.update(yaml=_yaml, plain=_plain, variables=_variables, application=_application)
    return environment


def _render(template: str, **values: object) -> str:
    return _templates().get_template(template).render(**values)


def _sandbox_command(plan: Plan) -> tuple[str, ...]:
    """It sleeps, or gives the application the test's time."""
    if plan.lockstep is None:
        return ("sleep", "infinity")
    return (f"{TIME_MOUNT}/{TIME}", *agent_flags(plan.application.services, plan.seed))


def render_plan(plan: Plan, defaults: Defaults = NO_DEFAULTS) -> list[File]:
    """The compose layers, ``compose.yaml`` and ``.env`` that name them, and ``test.json`` of one test.

    Flags at their ``defaults`` are left out of the layers.
    """
    names = {layer: f"{layer}.compose.yml" for layer in LAYERS}
    own_network = plan.isolation == "network"
    files = [
        File(
            f"{plan.slug}/{names[layer]}",
            _render(
                "layer.compose.yml.j2",
                plan=plan,
                layer=layer,
                common=containers(plan, layer, defaults),
                ready_tries=READY_TRIES,
                channel=CHANNEL,
                recorder=RECORDER,
                own_network=own_network,
                sandbox=own_network and layer == LAYERS[0],
                sandbox_command=_sandbox_command(plan),
                time=TIME_MOUNT if plan.lockstep else "",
                copies=plan.application.copies if layer == LAYERS[0] else {},
                files_service=FILES,
                copy_command=copy_command(plan.application),
            ),
        )
        for layer in LAYERS
        if layer != "application"
    ]
    files.append(File(f"{plan.slug}/{names['application']}", _render("application.compose.yml.j2", plan=plan)))
    judges = [service.name for service in plan.services if service.judge]
    for path, template in (("compose.yaml", "compose.yaml.j2"), (".env", "env.j2")):
        text = _render(template, plan=plan, files=list(names.values()), judges=judges)
        files.append(File(f"{plan.slug}/{path}", text))
    files.append(File(f"{plan.slug}/test.json", to_json(plan)))
    return files


def render_pipeline(child: Pipeline) -> File:
    parts = {field.name: getattr(child, field.name) for field in fields(child)}
    return File(CHILD, _render("child.gitlab-ci.yml.j2", spare_minutes=SPARE_MINUTES, **parts))
