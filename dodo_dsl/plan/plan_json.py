"""A Plan as JSON, in ``test.json``."""

import dataclasses
import json
import re
from graphlib import CycleError, TopologicalSorter
from typing import Any, get_args

import orjson

from dodo_dsl.application.access.model import Access
from dodo_dsl.plan.model import (
    COMPLETED,
    HEALTHY,
    LAYERS,
    STARTED,
    Application,
    ApplicationService,
    Flag,
    FlagKind,
    Lockstep,
    Place,
    Plan,
    PlannedService,
    Pooled,
    is_device,
)
from dodo_dsl.plan.test_files import is_shared_name
from dodo_dsl.spec.deployment.sandbox_limits import SandboxLimits
from dodo_dsl.spec.goals import Goal, is_goal
from dodo_dsl.spec.instances.matrix import SLUG
from dodo_dsl.spec.model import LEVELS
from dodo_dsl.spec.resource_limits import ResourceLimits, is_valid
from dodo_dsl.spec.settings import Settings

FORMAT = 1
_LISTS = ("more_tags", "messages", "senders", "truth", "world", "told", "import_paths")
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]*")


class PlanError(ValueError):
    """A ``test.json`` that this version cannot read."""


def to_json(plan: Plan) -> str:
    own = {field.name: getattr(plan, field.name) for field in dataclasses.fields(plan)}
    document = {"dodo": "plan", "version": FORMAT, **own}
    return json_text(document, orjson.OPT_INDENT_2 | orjson.OPT_APPEND_NEWLINE)


def json_text(value: Any, option: int = 0) -> str:
    """JSON by orjson; raises UnicodeEncodeError where a text is not UTF-8, as a path may be."""
    try:
        return orjson.dumps(value, option=option).decode()
    except TypeError:
        json.dumps(value, ensure_ascii=False, default=dataclasses.asdict).encode()  # it tells which text
        raise


def from_json(text: str, settings: Settings = Settings()) -> Plan:  # noqa: B008  (it is frozen)
    """The Plan that ``to_json`` wrote, with the settings' seed and wall timeout; raises PlanError for anything else."""
    try:
        raw = json.loads(text)
        if raw.pop("dodo") != "plan" or raw.pop("version") != FORMAT:
            raise PlanError(f"not a plan of version {FORMAT}")
        raw["services"] = tuple(_service(s) for s in raw["services"])
        application = raw["application"]
        application["services"] = tuple(_application_service(s) for s in application["services"])
        application["changes"] = tuple(application["changes"])
        application["hidden"] = tuple(application["hidden"])
        reads = tuple(application["limits"]["reads"])
        application["limits"] = SandboxLimits(**{**application["limits"], "reads": reads})
        application["access"] = _access(application["access"])
        raw["application"] = Application(**application)
        if settings.seed is not None:
            raw["seed"] = settings.seed
        if settings.wall_timeout_s is not None and raw["lockstep"]:
            raw["lockstep"]["wall_timeout_s"] = settings.wall_timeout_s
        raw["lockstep"] = Lockstep(**raw["lockstep"]) if raw["lockstep"] else None
        raw["resources"] = ResourceLimits(**raw["resources"]) if raw["resources"] else None
        raw |= {key: tuple(raw[key]) for key in _LISTS}
        raw["shared"] = dict(raw["shared"])
        raw["pool"] = Pooled(**raw["pool"]) if raw["pool"] else None
        raw["goals"] = tuple(Goal(**goal) for goal in raw["goals"])
        raw["source_map"] = {key: Place(**place) for key, place in raw["source_map"].items()}
        plan = Plan(**raw)
        problem = _problem(plan)
    except (KeyError, TypeError, AttributeError, ValueError, RecursionError) as error:
        raise PlanError(f"not a compiled test ({error}); compile it again") from error
    if problem:
        raise PlanError(f"not a compiled test (wrong {problem}); compile it again")
    return plan


def _problem(plan: Plan) -> str:
    """The first value that is wrong, or an empty string; JSON itself checks no types."""
    texts = (plan.name, plan.spec, plan.description, plan.kind, plan.tag, *plan.more_tags, plan.rig)
    services: list[PlannedService | ApplicationService] = [*plan.services, *plan.application.services]
    rules = {
        "slug": isinstance(plan.slug, str) and bool(SLUG.fullmatch(plan.slug)),
        "pool": plan.pool is None or _is_pooled(plan.pool),
        "string": all(isinstance(text, str) and "\0" not in text for text in (*texts, plan.application.folder)),
        "level": plan.level in LEVELS,
        "isolation": plan.isolation in ("network", "host"),
        "timeout_s": isinstance(plan.timeout_s, int | float) and 0 < plan.timeout_s <= 86_400,
        "cid": isinstance(plan.cid, int) and 1 <= plan.cid <= 254,
        "seed": isinstance(plan.seed, int) and 0 <= plan.seed < 1 << 32,
        "lockstep": plan.lockstep is None or _is_lockstep(plan.lockstep),
        "messages": all(_is_inside(path) for path in plan.messages),
        "senders": all(isinstance(word, str) and len(word.split()) == 1 for word in _words(plan)),
        "shared file": all(_is_inside(path) and is_shared_name(name) for path, name in plan.shared.items()),
        "import path": all(isinstance(path, str) and "\0" not in path for path in plan.import_paths),
        "goal": all(isinstance(goal.check, str) and is_goal(goal) for goal in plan.goals),
        "service name": all(isinstance(s.name, str) and _NAME.fullmatch(s.name) for s in services),
        "service layer": all(s.layer in LAYERS for s in plan.services),
        "flag": all(_is_flag(flag) for s in plan.services for flag in s.flags),
        "set-up time": all(isinstance(s.setup_s, int | float) and 0 <= s.setup_s <= 86_400 for s in plan.services),
        "port": all(isinstance(s.port, str) and "\0" not in s.port for s in plan.services),
        "device": all(is_device(d) for s in plan.services for d in s.devices),
        "command": all(isinstance(w, str) for s in services for w in s.process or ())
        and all(isinstance(w, str) for s in plan.application.services for w in s.command),
        "environment": all(isinstance(s.environment, dict) for s in plan.application.services),
        "variable": all(isinstance(v, str) for v in plan.application.variables.values()),
        "secret": all(isinstance(text, str) for pair in plan.application.secrets.items() for text in pair),
        "copy": all(isinstance(text, str) for pair in plan.application.copies.items() for text in pair),
        "access": _is_access(plan.application.access),
        "resources": plan.resources is None or is_valid(plan.resources),
        "message": all(isinstance(m, str) for s in plan.application.services for m in (*s.inputs, *s.outputs)),
        "condition": all(_is_after(s, plan.application) for s in plan.application.services),
        "order of starts: services wait for one another": not _is_cyclic(plan.application),
        "environment file": all(isinstance(f, str) for s in plan.application.services for f in s.env_files),
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


def _words(plan: Plan) -> tuple[str, ...]:
    return (*plan.senders, *plan.truth, *plan.world, *plan.told)


def _access(raw: dict[str, Any]) -> Access:
    return Access(**{**raw, **{key: tuple(raw[key]) for key in ("roots", "paths", "passed", "ports")}})


def _is_access(access: Access) -> bool:
    texts = (*access.roots, *access.paths, *access.passed, *access.ports)
    flags = (access.outside, access.devices, access.privileged)
    return all(isinstance(text, str) for text in texts) and all(isinstance(flag, bool) for flag in flags)


def _is_pooled(pool: Pooled) -> bool:
    return isinstance(pool.name, str) and isinstance(pool.slug, str) and bool(SLUG.fullmatch(pool.slug))


def _is_lockstep(lockstep: Lockstep) -> bool:
    numbers = isinstance(lockstep.readers, int) and isinstance(lockstep.wall_timeout_s, int | float)
    limit, over = lockstep.max_response_s, lockstep.response_over
    limited = limit is None or (isinstance(limit, int | float) and 0 < limit <= 3600)
    shared = isinstance(over, int | float) and 0 <= over <= 1 and isinstance(lockstep.is_copied, bool)
    in_range = numbers and 1 <= lockstep.readers <= 1000 and 0 < lockstep.wall_timeout_s <= 10 * 86_400 + 60
    return in_range and limited and shared


def _is_flag(flag: Flag) -> bool:
    kinds = get_args(FlagKind)
    plain = isinstance(flag.name, str) and isinstance(flag.value, str) and isinstance(flag.kind, str)
    inside = flag.kind not in ("path", "report") or _is_inside(flag.value)
    return plain and flag.kind in kinds and inside


def _is_inside(path: object) -> bool:
    return isinstance(path, str) and ".." not in path.split("/") and not path.startswith("/")


def _service(raw: dict[str, Any]) -> PlannedService:
    words = {key: tuple(raw[key]) for key in ("process", "devices")}
    return PlannedService(**{**raw, **words, "flags": tuple(Flag(**f) for f in raw["flags"])})


def _application_service(raw: dict[str, Any]) -> ApplicationService:
    process = raw["process"]
    words = {"process": None if process is None else tuple(process), "command": tuple(raw["command"])}
    lists = {key: tuple(raw[key]) for key in ("env_files", "inputs", "outputs", "optional")}
    return ApplicationService(**{**raw, **words, **lists})
