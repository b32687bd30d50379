"""The Plan: frozen, made of plain values, and the same as JSON in ``test.json``."""

import dataclasses
import json
import re
from dataclasses import dataclass, field
from typing import Any, Literal, get_args

import orjson

FORMAT = 1
_SLUG = re.compile(r"[a-z0-9]+(-+[a-z0-9]+)*")
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]*")
_DEVICE = re.compile(r"/dev(/[A-Za-z0-9_:.-]*[A-Za-z0-9_:-][A-Za-z0-9_:.-]*)+")
READY_S = 60.0
"""How long every service may take to get ready."""
LAYERS = ("environment", "action", "evaluation", "application")

FlagKind = Literal["text", "path", "memory", "memories", "report"]


@dataclass(frozen=True)
class Flag:
    """``--name=value``; a path lies below ``files/``, a report below the report's folder, both relative."""

    name: str
    value: str
    kind: FlagKind = "text"


@dataclass(frozen=True)
class Service:
    """A service of DoDo or of the deployment; ``judge`` marks the ones whose verdict counts.

    ``devices`` are device files of the machine that it needs, ``setup_s`` the seconds that it may take to get ready
    beyond those that every service has.
    """

    layer: str
    name: str
    uses: str
    image: str
    process: tuple[str, ...]
    flags: tuple[Flag, ...] = ()
    judge: bool = False
    devices: tuple[str, ...] = ()
    setup_s: float = 0.0


@dataclass(frozen=True)
class ApplicationService:
    """A service under test; ``process`` is what starts it without containers, None when only an image can."""

    name: str
    process: tuple[str, ...] | None = None
    command: tuple[str, ...] = ()
    environment: dict[str, str | None] = field(default_factory=dict)
    takes_cid: bool = False
    takes_memory: bool = False
    env_files: tuple[str, ...] = ()


@dataclass(frozen=True)
class Application:
    """The application; ``folder`` is its compose file's folder, relative to the compiled test's.

    ``variables`` are those of its ``.env``, as compose interpolates them.
    """

    folder: str
    services: tuple[ApplicationService, ...]
    compose: dict[str, Any] = field(default_factory=dict)
    changes: tuple[str, ...] = ()
    variables: dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Place:
    """Where in a spec something was written; ``file`` is relative to the repository, or else to the registry."""

    file: str
    line: int
    column: int


@dataclass(frozen=True)
class Lockstep:
    """How a test in lockstep goes: how many processes read each picture, and its limit of wall time in seconds."""

    readers: int
    wall_timeout_s: float


@dataclass(frozen=True)
class Plan:
    """One instance of a test. Times in seconds, ``subnet`` an IPv4 /28 or empty under host isolation.

    ``lockstep`` is None in real time, ``rig`` empty below level hil; ``messages`` are ODVD files of the deployment,
    relative to ``files/``.
    """

    name: str
    slug: str
    spec: str
    description: str
    level: str
    kind: str
    timeout_s: float
    clock: str
    isolation: str
    seed: int
    cid: int
    subnet: str
    tag: str
    sandbox_image: str
    services: tuple[Service, ...]
    application: Application
    lockstep: Lockstep | None = None
    rig: str = ""
    messages: tuple[str, ...] = ()
    source_map: dict[str, Place] = field(default_factory=dict)

    @property
    def variables(self) -> dict[str, str]:
        """Environment variables by which the test's services know their clock and that they are on a rig."""
        stepped = {"DODO_CLOCK": self.clock, "DODO_READERS": str(self.lockstep.readers)} if self.lockstep else {}
        return {**stepped, **({"DODO_RIG": self.rig} if self.rig else {})}

    def layer(self, name: str) -> tuple[Service, ...]:
        return tuple(s for s in self.services if s.layer == name)


@dataclass(frozen=True)
class Suite:
    """All instances of a compilation, in name order."""

    plans: tuple[Plan, ...]
    gates: bool = True


class PlanError(ValueError):
    """A ``test.json`` that this version cannot read."""


def to_json(plan: Plan) -> str:
    own = {field.name: getattr(plan, field.name) for field in dataclasses.fields(plan)}
    document = {"dodo": "plan", "version": FORMAT, **own}
    return orjson.dumps(document, option=orjson.OPT_INDENT_2 | orjson.OPT_APPEND_NEWLINE).decode()


def from_json(text: str) -> Plan:
    """The Plan that ``to_json`` wrote; raises PlanError for anything else."""
    try:
        raw = json.loads(text)
        if raw.pop("dodo") != "plan" or raw.pop("version") != FORMAT:
            raise PlanError(f"not a plan of version {FORMAT}; compile the test again")
        raw["services"] = tuple(_service(s) for s in raw["services"])
        application = raw["application"]
        application["services"] = tuple(_application_service(s) for s in application["services"])
        application["changes"] = tuple(application["changes"])
        raw["application"] = Application(**application)
        raw["lockstep"] = Lockstep(**raw["lockstep"]) if raw["lockstep"] else None
        raw["messages"] = tuple(raw["messages"])
        raw["source_map"] = {key: Place(**place) for key, place in raw["source_map"].items()}
        plan = Plan(**raw)
        problem = _problem(plan)
    except (KeyError, TypeError, AttributeError, ValueError, RecursionError) as error:
        raise PlanError(f"not a compiled test ({error}); compile it again") from error
    if problem:
        raise PlanError(f"not a compiled test ({problem}); compile it again")
    return plan


def _problem(plan: Plan) -> str:
    """What no compiled test holds; the types of JSON say nothing about themselves."""
    texts = (plan.name, plan.spec, plan.description, plan.kind, plan.tag, plan.rig, plan.application.folder)
    services: list[Service | ApplicationService] = [*plan.services, *plan.application.services]
    rules = {
        "slug": isinstance(plan.slug, str) and bool(_SLUG.fullmatch(plan.slug)),
        "a text": all(isinstance(text, str) and "\0" not in text for text in texts),
        "level": plan.level in ("sil", "dil", "hil"),
        "isolation": plan.isolation in ("network", "host"),
        "timeout_s": isinstance(plan.timeout_s, int | float) and 0 < plan.timeout_s <= 86_400,
        "cid": isinstance(plan.cid, int) and 1 <= plan.cid <= 254,
        "seed": isinstance(plan.seed, int) and 0 <= plan.seed < 1 << 32,
        "lockstep": plan.lockstep is None or _is_lockstep(plan.lockstep),
        "messages": all(_is_inside(path) for path in plan.messages),
        "a service's name": all(isinstance(s.name, str) and _NAME.fullmatch(s.name) for s in services),
        "a service's layer": all(s.layer in LAYERS for s in plan.services),
        "a flag": all(_is_flag(flag) for s in plan.services for flag in s.flags),
        "a set-up": all(isinstance(s.setup_s, int | float) and 0 <= s.setup_s <= 86_400 for s in plan.services),
        "a device": all(is_device(d) for s in plan.services for d in s.devices),
        "a word": all(isinstance(w, str) for s in services for w in s.process or ())
        and all(isinstance(w, str) for s in plan.application.services for w in s.command),
        "an environment": all(isinstance(s.environment, dict) for s in plan.application.services),
        "a variable": all(isinstance(v, str) for v in plan.application.variables.values()),
        "a file": all(isinstance(f, str) for s in plan.application.services for f in s.env_files),
    }
    return next((name for name, holds in rules.items() if not holds), "")


def _is_lockstep(lockstep: Lockstep) -> bool:
    numbers = isinstance(lockstep.readers, int) and isinstance(lockstep.wall_timeout_s, int | float)
    return numbers and 1 <= lockstep.readers <= 1000 and 0 < lockstep.wall_timeout_s <= 10 * 86_400 + 60


def _is_flag(flag: Flag) -> bool:
    kinds = get_args(FlagKind)
    plain = isinstance(flag.name, str) and isinstance(flag.value, str) and isinstance(flag.kind, str)
    inside = flag.kind not in ("path", "report") or _is_inside(flag.value)
    return plain and flag.kind in kinds and inside


def is_device(path: str) -> bool:
    """Whether a text is the path of a device file below /dev."""
    return bool(_DEVICE.fullmatch(path))


def _is_inside(path: object) -> bool:
    return isinstance(path, str) and ".." not in path.split("/") and not path.startswith("/")


def _service(raw: dict[str, Any]) -> Service:
    words = {key: tuple(raw[key]) for key in ("process", "devices")}
    return Service(**{**raw, **words, "flags": tuple(Flag(**f) for f in raw["flags"])})


def _application_service(raw: dict[str, Any]) -> ApplicationService:
    process = raw["process"]
    words = {"process": None if process is None else tuple(process), "command": tuple(raw["command"])}
    return ApplicationService(**{**raw, **words, "env_files": tuple(raw["env_files"])})
