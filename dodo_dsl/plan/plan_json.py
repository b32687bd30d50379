"""A Plan as JSON, in ``test.json``."""

import dataclasses
import json
import re
from dataclasses import astuple, replace
from graphlib import CycleError, TopologicalSorter
from typing import Any

import orjson

from dodo_dsl.application.printed_lines import PatternError, compiled
from dodo_dsl.plan.model import (
    COMPLETED,
    HEALTHY,
    LAYERS,
    STARTED,
    Application,
    ApplicationService,
    Lockstep,
    Plan,
    PlannedService,
    is_device,
)
from dodo_dsl.plan.test_files import is_shared_name
from dodo_dsl.spec.load import Settings
from dodo_dsl.spec.matrix import SLUG
from dodo_dsl.spec.model import LEVELS, is_goal

FORMAT = 1
_RARE = frozenset({"lines", "timed", "emulated", "raw_files"})
"""Keys that are written if there is a value."""
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]*")


class PlanError(ValueError):
    """A ``test.json`` that this version cannot read."""


def to_json(plan: Plan) -> str:
    application = {**_shallow(plan.application), "services": [*map(_without_nothing, plan.application.services)]}
    document = {"dodo": "plan", "version": FORMAT, **_without_nothing(plan), "application": application}
    return json_text(document, orjson.OPT_INDENT_2 | orjson.OPT_APPEND_NEWLINE)


def _shallow(value: Any) -> dict[str, Any]:
    return {field.name: getattr(value, field.name) for field in dataclasses.fields(value)}


def _without_nothing(value: Any) -> dict[str, Any]:
    return {name: each for name, each in _shallow(value).items() if each or name not in _RARE}


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
        if not _is_complete(plan) or json.loads(to_json(plan)) != raw:
            raise PlanError("its keys are not those of this version")
        plan = _with_settings(plan, settings)
    except (KeyError, TypeError, AttributeError, ValueError, RecursionError, msgspec.ValidationError) as error:
        raise PlanError(f"not a compiled test ({error}); compile it again") from error
    if problem := _problem(plan):
        raise PlanError(f"not a compiled test (wrong {problem}); compile it again")
    return plan


def _is_complete(value: Any) -> bool:
    """Whether nothing that msgspec read lacks a key: it leaves a field with a default to the class."""
    if isinstance(value, tuple):
        return all(map(_is_complete, value))
    fields = getattr(value, "__dataclass_fields__", {})
    missing = fields.keys() - vars(value).keys() - _RARE if fields else ()
    return not fields or (not missing and all(map(_is_complete, vars(value).values())))


def _with_settings(plan: Plan, settings: Settings) -> Plan:
    if settings.seed is not None:
        plan = replace(plan, seed=settings.seed)
    if settings.wall_timeout_s is not None and plan.lockstep is not None:
        plan = replace(plan, lockstep=replace(plan.lockstep, wall_timeout_s=settings.wall_timeout_s))
    return plan


def _limits(plan: Plan) -> tuple[float | None, ...]:
    return astuple(plan.resources) if plan.resources else ()


def _problem(plan: Plan) -> str:
    """The first value that is wrong, or an empty string; its type is right."""
    texts = (plan.name, plan.spec, plan.description, plan.kind, plan.tag, *plan.more_tags, plan.rig)
    application = plan.application
    services: list[PlannedService | ApplicationService] = [*plan.services, *application.services]
    rules = {
        "slug": SLUG.fullmatch(plan.slug) and (plan.pool is None or SLUG.fullmatch(plan.pool.slug)),
        "string": not any("\0" in text for text in (*texts, application.folder)),
        "level": plan.level in LEVELS,
        "isolation": plan.isolation in ("network", "host"),
        "timeout_s": 0 < plan.timeout_s <= 86_400,
        "cid": 1 <= plan.cid <= 254,
        "seed": 0 <= plan.seed < 1 << 32,
        "lockstep": plan.lockstep is None or _is_lockstep(plan.lockstep),
        "messages": all(map(_is_inside, plan.messages)),
        "senders": all(len(word.split()) == 1 for word in (*plan.senders, *plan.truth, *plan.world, *plan.told)),
        "shared file": all(_is_inside(path) and is_shared_name(name) for path, name in plan.shared.items()),
        "import path": not any("\0" in path for path in plan.import_paths),
        "goal": all(map(is_goal, plan.goals)),
        "service name": all(_NAME.fullmatch(s.name) for s in services),
        "service layer": all(s.layer in LAYERS for s in plan.services),
        "flag": all(f.kind not in ("path", "report") or _is_inside(f.value) for s in plan.services for f in s.flags),
        "set-up time": all(0 <= s.setup_s <= 86_400 for s in plan.services),
        "port": not any("\0" in s.port for s in plan.services),
        "device": all(is_device(d) for s in plan.services for d in s.devices),
        "resources": all(limit is None or 0 <= limit < float("inf") for limit in _limits(plan)),
        "line": all(
            0 <= line.sender < 1 << 32 and _is_pattern(line.match) for s in application.services for line in s.lines
        ),
        "condition": all(_is_after(s, application) for s in application.services),
        "order of starts: services wait for one another": not _is_cyclic(application),
    }
    return next((name for name, holds in rules.items() if not holds), "")


def _is_after(service: ApplicationService, application: Application) -> bool:
    names = {service.name for service in application.services}
    conditions = {STARTED, HEALTHY, COMPLETED}
    known = all(name in names and c in conditions for name, c in service.after.items())
    return known and all(name in service.after for name in service.optional)


def _is_cyclic(application: Application) -> bool:
    try:
        tuple(TopologicalSorter({s.name: s.after for s in application.services}).static_order())
    except CycleError:
        return True
    return False


def _is_lockstep(lockstep: Lockstep) -> bool:
    limit = lockstep.max_response_s
    is_limit = (limit is None or 0 < limit <= 3600) and 0 <= lockstep.response_over <= 1
    return is_limit and 1 <= lockstep.readers <= 1000 and 0 < lockstep.wall_timeout_s <= 10 * 86_400 + 60


def _is_pattern(text: str) -> bool:
    try:
        compiled(text)
    except PatternError:
        return False
    return True


def _is_inside(path: str) -> bool:
    return ".." not in path.split("/") and not path.startswith("/")
