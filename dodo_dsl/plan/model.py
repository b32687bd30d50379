"""The Plan: frozen, of plain values, and final once it is built."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal

from dodo_dsl.application.model import Access
from dodo_dsl.spec import model as spec_model
from dodo_dsl.spec.model import Goal, ResourceLimits
from dodo_dsl.spec.rig import EMULATED_RIGS, KIND_TAGS
from dodo_dsl.spec.sandbox_limits import SandboxLimits

_DEVICE = re.compile(r"/dev(/[A-Za-z0-9_:.-]*[A-Za-z0-9_:-][A-Za-z0-9_:.-]*)+")
READY_S = 60.0
"""The seconds that every service may take to get ready."""
LAYERS = (*spec_model.LAYERS, "application")
STARTED, HEALTHY, COMPLETED = "service_started", "service_healthy", "service_completed_successfully"
"""The conditions of ``depends_on``."""

FlagKind = Literal["text", "path", "memory", "memories", "report"]


ENDS_INPUT = "ends-input"
"""The flag of an evaluator whose verdict ends the drive."""
DISPLAY_SERVER = ("xvfb-run", "-a", "-s", "-screen 0 1920x1080x24 -nolisten tcp")
"""What starts a program with its own X server (xvfb-run(1))."""


@dataclass(frozen=True)
class Flag:
    """``--name=value``; a path lies below ``files/``, a report below the report's folder, both relative."""

    name: str
    value: str
    kind: FlagKind = "text"


@dataclass(frozen=True)
class PlannedService:
    """A service of DoDo or of the deployment; ``judge`` marks the ones whose verdict counts.

    ``devices`` are the device files that it needs, ``setup_s`` the seconds that it may take to get ready beyond
    ``READY_S``. ``port`` is the rig's, which no other service may open; empty if it moves none, or the emulated one.
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
    port: str = ""


@dataclass(frozen=True)
class Line:
    """What a service prints: a line in which RE2 finds ``match`` is a message, whose fields are the named groups.

    ``sample_time`` is the unit of that, ``take`` says which of several lines in a step count.
    """

    match: str
    message: str
    sender: int = 0
    sample_time: str = "us"
    take: str = "all"


@dataclass(frozen=True)
class ApplicationService:
    """A service under test; ``process`` starts it without containers, None when only its image can.

    ``inputs`` and ``outputs`` are the messages that it declares, each ``name`` or ``name/senderStamp``. ``after`` are
    the services for which it waits, each with its condition; without the ``optional`` ones of them it starts, too.
    ``raw_files`` are those of ``env_files`` whose values are as they are written.
    """

    name: str
    process: tuple[str, ...] | None = None
    command: tuple[str, ...] = ()
    environment: dict[str, str | None] = field(default_factory=dict)
    takes_cid: bool = False
    takes_memory: bool = False
    env_files: tuple[str, ...] = ()
    raw_files: tuple[str, ...] = ()
    inputs: tuple[str, ...] = ()
    outputs: tuple[str, ...] = ()
    after: dict[str, str] = field(default_factory=dict)
    optional: tuple[str, ...] = ()
    lines: tuple[Line, ...] = ()


@dataclass(frozen=True)
class Application:
    """The application; ``folder`` is its compose file's folder, relative to the compiled test's.

    ``hidden`` is what it never sees of its repository, relative to its folder. ``secrets`` are variables of its
    ``.env`` that are filled in when it starts, each with the file that sets it, relative to the compiled test's folder
    as the roots of ``access`` are. ``copies`` are volumes of the test, each with the folder of the repository that is
    copied into it before the application starts.
    """

    folder: str
    services: tuple[ApplicationService, ...]
    compose: dict[str, Any] = field(default_factory=dict)
    changes: tuple[str, ...] = ()
    limits: SandboxLimits = field(default_factory=SandboxLimits)
    hidden: tuple[str, ...] = ()
    secrets: dict[str, str] = field(default_factory=dict)
    access: Access = field(default_factory=Access)
    copies: dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Place:
    """A place in a spec; ``file`` is relative to the repository, or else to the registry."""

    file: str
    line: int
    column: int


@dataclass(frozen=True)
class Lockstep:
    """A test in lockstep: the number of processes that read each frame, and the limit of wall time in seconds.

    ``max_response_s`` is the longest that an answer may take, None for no limit; ``response_over`` the share of answers
    that may take longer; ``is_copied`` means that each has to carry the sample time of its frame.
    """

    readers: int
    wall_timeout_s: float
    max_response_s: float | None = None
    response_over: float = 0.0
    is_copied: bool = False


@dataclass(frozen=True)
class Pooled:
    """The test of a Plan for one rig of a pool, by the name and slug that it has whichever rig runs it."""

    name: str
    slug: str


@dataclass(frozen=True)
class Plan:
    """One instance of a test. Times in seconds, ``subnet`` an IPv4 network or empty under host isolation.

    ``lockstep`` is None in real time, ``rig`` empty below level hil, ``emulated`` says whether it is; ``more_tags`` are
    its runner's besides ``tag``; ``pool`` is None for a test that names its rig; ``messages`` are ODVD files of the
    deployment, relative to ``files/``; ``senders`` has the only senders of a message, as ``opendlv.sim.Frame/0=pose``.
    ``goals`` score a passed test and never change its outcome; the report shows the check ``headline`` first.
    ``truth`` are messages by which evaluators judge, which the application never gets.
    ``world`` are the services that get what the application must not hear, and those of the deployment with what they
    consume of it, as ``judge?=opendlv.sim.Frame/0``; ``told`` is what the application declares to take of it, and gets.
    ``import_paths`` are folders that hold Python packages of the deployment's own services, relative to the compiled
    test's. ``shared`` are files below ``files/`` that are links, each with the name of its file in the folder of files
    that tests share.
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
    services: tuple[PlannedService, ...]
    application: Application
    lockstep: Lockstep | None = None
    resources: ResourceLimits | None = None
    rig: str = ""
    more_tags: tuple[str, ...] = ()
    pool: Pooled | None = None
    messages: tuple[str, ...] = ()
    senders: tuple[str, ...] = ()
    truth: tuple[str, ...] = ()
    world: tuple[str, ...] = ()
    told: tuple[str, ...] = ()
    goals: tuple[Goal, ...] = ()
    headline: str = ""
    import_paths: tuple[str, ...] = ()
    shared: dict[str, str] = field(default_factory=dict)
    source_map: dict[str, Place] = field(default_factory=dict)
    emulated: bool = False

    @property
    def is_real(self) -> bool:
        return bool(self.rig) and not self.emulated and self.rig not in EMULATED_RIGS

    @property
    def lacks_rig(self) -> bool:
        """Whether the deployment has no rig of its kind, and does not say that such a rig is emulated."""
        return self.emulated and self.tag in KIND_TAGS.get(self.rig, ())

    @property
    def variables(self) -> dict[str, str]:
        """Environment variables that give the test's services their clock, their rig, and the senders of messages."""
        stepped = {"DODO_CLOCK": self.clock, "DODO_READERS": str(self.lockstep.readers)} if self.lockstep else {}
        rig = {"DODO_RIG": self.rig} if self.rig else {}
        lists = {
            "DODO_SENDERS": self.senders,
            "DODO_WORLD": self.world,
            "DODO_TOLD": self.told,
            "DODO_TRUTH": self.truth,
        }
        return {**stepped, **rig, **{name: " ".join(words) for name, words in lists.items() if words}}

    def place_named_in(self, text: str) -> Place | None:
        """Where the spec, or the application's compose file, has the service that a message names; None for none."""
        keys = {service.name: f"application.{service.name}" for service in self.application.services}
        keys |= {service.name: f"{service.layer}.{service.name}" for service in self.services}
        for name in sorted(keys, key=len, reverse=True):
            if re.search(rf"(?<![\w-]){re.escape(name)}(?![\w-])", text):
                return self.source_map.get(keys[name])
        return None

    def layer(self, name: str) -> tuple[PlannedService, ...]:
        return tuple(s for s in self.services if s.layer == name)


@dataclass(frozen=True)
class Suite:
    plans: tuple[Plan, ...]
    gates: bool = True


def is_device(path: str) -> bool:
    return bool(_DEVICE.fullmatch(path))


def runs(plans: Sequence[Plan], repeat: int) -> list[tuple[Plan, str]]:
    """Each Plan ``repeat`` times with its slug, round by round; from the second on, its name and slug say which."""
    return [(_repetition(plan, number), plan.slug) for number in range(1, repeat + 1) for plan in plans]


def _repetition(plan: Plan, number: int) -> Plan:
    if number == 1:
        return plan
    name, slug = f"[run={number}]", f"--run-{number}"
    pool = plan.pool and replace(plan.pool, name=plan.pool.name + name, slug=plan.pool.slug + slug)
    return replace(plan, name=plan.name + name, slug=plan.slug + slug, pool=pool)


def pooled(plans: Sequence[Plan]) -> list[tuple[Plan, ...]]:
    """The Plans of each test, one for each rig of its pool, of which one is to be run; in the order given."""
    groups: dict[str, list[Plan]] = {}
    for plan in plans:
        groups.setdefault(named(plan).slug, []).append(plan)
    return [tuple(group) for group in groups.values()]


def named(plan: Plan) -> Plan:
    """The Plan under the name of its test, whichever rig it is for."""
    return replace(plan, name=plan.pool.name, slug=plan.pool.slug) if plan.pool else plan
