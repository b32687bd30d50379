"""What an application may use of its host, and what was found in its compose files that it may not, at its place.

Each finding has a kind, which says what the three looks at a file do with it.

========== ==================== =============================== ==========================================
kind       when it is compiled  in the test's copy              before anything is created
========== ==================== =============================== ==========================================
refused    an error                                             refused
unknown    an error                                             refused
hardware   a warning            gone without a rig              refused without a rig
privilege  a warning            gone, unless the rig allows it  refused, unless the rig allows it
left out   a warning            gone, unless the rig allows it  refused, unless the rig allows it
port       a warning            gone                            refused
limit      a warning            has what is ``allowed``         refused
unlimited  nothing              has what is ``allowed``         refused
========== ==================== =============================== ==========================================
"""

from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal, NamedTuple

from dodo_dsl import source
from dodo_dsl.application.access.host_paths import HostPaths
from dodo_dsl.diagnostics import Diagnostic, Fix, Severity, Span, did_you_mean, only_fix
from dodo_dsl.source import Node, Scalar
from dodo_dsl.spec.sandbox_limits import SandboxLimits

Steps = tuple[str | int, ...]
Kind = Literal["refused", "unknown", "hardware", "privilege", "left out", "port", "limit", "unlimited"]
Treatment = Literal["kept", "rewritten", "removed", "refused"]


@dataclass(frozen=True)
class Access:
    """What a test's application may use of its host.

    ``roots`` are folders whose files are the application's own, besides those of its repository, ``paths`` others that
    it may mount, ``passed`` variables of DoDo's own environment. ``outside`` says whether it may reach other networks,
    ``devices`` and ``privileged`` what its rig allows. ``ports`` are those of the deployment's rigs: it gets none.
    """

    roots: tuple[str, ...] = ()
    paths: tuple[str, ...] = ()
    passed: tuple[str, ...] = ()
    outside: bool = False
    devices: bool = False
    privileged: bool = False
    ports: tuple[str, ...] = ()

    def allows(self, kind: Kind) -> bool:
        """Whether the rig allows what was found."""
        if kind == "hardware":
            return self.devices
        return kind in ("privilege", "left out") and self.devices and self.privileged


@dataclass(frozen=True)
class AccessFinding:
    """A key or value that a test may not have; ``steps`` lead to it from where the search began.

    A test's copy has what is ``allowed`` in the place of a limit.
    """

    steps: Steps
    message: str
    hint: str = ""
    kind: Kind = "refused"
    fix: Fix | None = None
    allowed: int | float | str = ""

    def below(self, *steps: str | int) -> "AccessFinding":
        return replace(self, steps=(*steps, *self.steps))


@dataclass(frozen=True)
class Look:
    """What a service, a volume, a secret or a config called ``name`` is judged by; ``what`` it is, with an article.

    ``containers`` and ``volumes`` are the application's, ``ports`` those of rigs, ``limits`` the highest that it may
    set. ``passed`` are variables of DoDo's own environment. ``compiled`` means that a test's copy is judged, as compose
    shows it: ``images`` are then DoDo's own, and ``own_network`` means that the test has one.
    """

    paths: HostPaths
    name: str = ""
    what: str = ""
    containers: Mapping[str, str] = field(default_factory=dict)
    volumes: Mapping[str, Any] = field(default_factory=dict)
    ports: tuple[str, ...] = ()
    limits: SandboxLimits = field(default_factory=SandboxLimits)
    passed: Collection[str] = ()
    compiled: bool = False
    images: Collection[str] = ()
    own_network: bool = False


Check = Callable[[Mapping[str, Any], Look], Iterator[AccessFinding]]


class KeyRow(NamedTuple):
    """What becomes of a key, and why; the ``check`` judges the mapping that may have it for the values of the key."""

    treatment: Treatment
    why: str
    check: Check | None = None


Rows = Mapping[str, KeyRow]


def mapping_findings(what: str, rows: Rows, written: Mapping[str, Any], look: Look) -> Iterator[AccessFinding]:
    """Keys without a row, those that are refused, in a compiled file also those that are removed, and values."""
    for key, value in written.items():
        row = rows.get(str(key))
        if row is None and not str(key).startswith("x-"):
            hint, fix = did_you_mean(str(key), rows), only_fix(str(key), rows, written)
            yield AccessFinding((key,), f"unknown key '{key}' in {what}", hint, "unknown", fix)
        elif row is not None and value not in (None, False, "", "false", [], {}):
            is_left = look.compiled and row.treatment == "removed"
            if is_left or (row.treatment == "refused" and row.check is None):
                yield AccessFinding((key,), f"'{key}' of {what} cannot be isolated: {row.why}", "remove it")
    for check in dict.fromkeys(row.check for row in rows.values() if row.check):
        yield from check(written, look)


def items(written: Any, *keys: str) -> Iterator[tuple[Steps, Any]]:
    """Each item of a list that the keys lead to, or the single value instead of one, with the steps to it."""
    value = at(written, keys)
    listed = value if isinstance(value, list) else [] if value is None else [value]
    for number, item in enumerate(listed):
        yield (*keys, number), item


def at(written: Any, keys: Steps) -> Any:
    """The value that the keys lead to; None if there is none."""
    for key in keys:
        written = written.get(key) if isinstance(written, dict) else None
    return written


def mappings(written: Any, path: str, steps: Steps = ()) -> Iterator[tuple[Steps, dict[str, Any]]]:
    """The mappings at a path, with the steps that lead to them; ``*`` is an item of a list, or a name."""
    if not path:
        if isinstance(written, dict):
            yield steps, written
        return
    first, _, rest = path.partition(".")
    named = written if isinstance(written, dict) else {}
    listed = dict(enumerate(written)) if isinstance(written, list) else named
    below = listed if first == "*" else {first: named[first]} if first in named else {}
    for step, inner in below.items():
        yield from mappings(inner, rest, (*steps, step))


def diagnostic(finding: AccessFinding, node: Node, key: Span) -> Diagnostic:
    """A finding within a node, whose own key is at ``key``.

    ``application-isolation``: access to the host that tests would share. ``application-hardware``: hardware, which is
    left out of tests without a rig. ``application-limit``: a limit beyond that of the test, which takes its place.
    """
    span = place(node, finding.steps, key, of_key=finding.kind == "unknown")
    if finding.kind == "unknown":
        own = (
            f"your own keys begin with x-, such as x-{finding.steps[-1]}; docs/reference/compose-keys.md has compose's"
        )
        return Diagnostic(span, "unknown-key", finding.message, finding.hint or own, fix=finding.fix)
    if finding.kind in ("refused", "left out"):
        severity: Severity = "error" if finding.kind == "refused" else "warning"
        return Diagnostic(span, "application-isolation", finding.message, finding.hint, severity)
    if finding.kind == "limit":
        return Diagnostic(span, "application-limit", finding.message, finding.hint, "warning")
    hint = finding.hint or "test it on a rig (level hil)"
    return Diagnostic(span, "application-hardware", finding.message, hint, "warning")


def place(node: Node, steps: Steps, key: Span, of_key: bool = False) -> Span:
    """The position of the value that the steps lead to, or of its key: with ``of_key``, and if it has no text."""
    span = key
    for number, step in enumerate(steps, 1):
        if isinstance(node, source.Mapping) and step in node.entries:
            entry = node.entries[str(step)]
            node = entry.value
            is_key = of_key and number == len(steps)
            span = node.span if isinstance(node, Scalar) and node.text and not is_key else entry.key
        elif isinstance(node, source.Sequence) and isinstance(step, int) and step < len(node.items):
            node = node.items[step]
            span = node.span
    return span


def shown(steps: Steps) -> str:
    """The steps as people write them: ``services.driver.volumes[0]``."""
    return "".join(f"[{step}]" if isinstance(step, int) else f".{step}" for step in steps).removeprefix(".")
