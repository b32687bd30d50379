"""A Plan as JSON, in ``test.json``."""

import dataclasses
import json
import re
from dataclasses import replace
from typing import Any

import orjson

from dodo_dsl.plan.model import (
    LAYERS,
    Plan,
)
from dodo_dsl.plan.test_files import is_shared_name
from dodo_dsl.spec.load import Settings
from dodo_dsl.spec.matrix import SLUG
from dodo_dsl.spec.model import LEVELS

FORMAT = 1
_PATHS = ("path", "report")
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]*")


class PlanError(ValueError):
    """A ``test.json`` that this version cannot read."""


def to_json(plan: Plan) -> str:
    values = {field.name: getattr(plan, field.name) for field in dataclasses.fields(plan)}
    return json_text({"dodo": "plan", "version": FORMAT, **values}, orjson.OPT_INDENT_2 | orjson.OPT_APPEND_NEWLINE)


def json_text(value: Any, option: int = 0) -> str:
    """JSON by orjson; raises UnicodeEncodeError if a text is not UTF-8, as a path may be."""
    try:
        return orjson.dumps(value, option=option).decode()
    except TypeError:
        json.dumps(value, ensure_ascii=False, default=dataclasses.asdict).encode()  # it says which text
        raise


def from_json(text: str, settings: Settings = Settings()) -> Plan:  # noqa: B008  (it is frozen)
    """The Plan that ``to_json`` wrote, with the settings' seed and wall timeout; raises PlanError for anything else."""
    import msgspec

    try:
        raw = json.loads(text)
        if raw["dodo"] != "plan" or raw["version"] != FORMAT:
            raise PlanError(f"not a plan of version {FORMAT}")
        plan = msgspec.convert(raw, Plan)
        if json.loads(to_json(plan)) != raw:
            raise PlanError("its keys are not those of this version")
        plan = _with_settings(plan, settings)
    except (KeyError, TypeError, AttributeError, ValueError, RecursionError, msgspec.ValidationError) as error:
        raise PlanError(f"not a compiled test ({error}); compile it again") from error
    if problem := _problem(plan):
        raise PlanError(f"not a compiled test (wrong {problem}); compile it again")
    return plan


def _with_settings(plan: Plan, settings: Settings) -> Plan:
    if settings.seed is not None:
        plan = replace(plan, seed=settings.seed)
    if settings.wall_timeout_s is not None and plan.lockstep is not None:
        plan = replace(plan, lockstep=replace(plan.lockstep, wall_timeout_s=settings.wall_timeout_s))
    return plan


def _problem(plan: Plan) -> str:
    """The first value with which nothing can be run, or whose path leads elsewhere; empty if there is none."""
    paths = [*plan.messages, *plan.shared, *(f.value for s in plan.services for f in s.flags if f.kind in _PATHS)]
    names = [*(s.name for s in plan.services), *(s.name for s in plan.application.services)]
    rules = {
        "slug": SLUG.fullmatch(plan.slug) and (plan.pool is None or SLUG.fullmatch(plan.pool.slug)),
        "level": plan.level in LEVELS,
        "isolation": plan.isolation in ("network", "host"),
        "timeout_s": 0 < plan.timeout_s <= 86_400,
        "cid": 1 <= plan.cid <= 254,
        "seed": 0 <= plan.seed < 1 << 32,
        "path": all(map(_is_inside, paths)),
        "shared file": all(map(is_shared_name, plan.shared.values())),
        "service name": all(map(_NAME.fullmatch, names)),
        "service layer": all(s.layer in LAYERS for s in plan.services),
    }
    return next((name for name, holds in rules.items() if not holds), "")


def _is_inside(path: str) -> bool:
    return ".." not in path.split("/") and not path.startswith("/")
