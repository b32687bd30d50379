"""A service as a process: flags, log, signals, readiness, and its exit code."""

import json
import logging
import os
import signal
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from types import FrameType
from typing import Any

from dodo_dsl.opendlv.bus.session import Session
from dodo_dsl.opendlv.memory.shared_memory import MemoryTakenError
from dodo_dsl.opendlv.messages.message_set import MessageSet
from services.base import crash
from services.base.clock import Clock, RealTimeClock
from services.base.flags import Flags, FlagsError, parse
from services.base.identity.key import take_key
from services.base.identity.members import Members
from services.base.identity.senders import SenderTable
from services.base.identity.world import World
from services.base.log_messages import published
from services.base.loop import Loop
from services.base.manifest import load_manifest
from services.base.service import Build, Context, Service
from services.base.usage import help_text
from services.base.verdict import undeclared_checks

DONE, BROKEN, USAGE = 0, 1, 2


def run(folder: Path, build: Build, argv: Sequence[str] | None = None, clock: Clock | None = None) -> int:
    """A service from its command line to its exit code: 0 done or stopped by a signal, 1 broken, 2 wrong flags.

    ``folder`` holds the manifest; ``build`` raises ValueError or OSError for unusable flags.
    """
    words = sys.argv[1:] if argv is None else argv
    manifest = load_manifest(folder)
    if "--help" in words:
        sys.stdout.write(help_text(manifest))
        return DONE
    name = manifest["name"]
    try:
        flags = parse(manifest, words)
    except FlagsError as error:
        sys.stderr.write(f"{name}: {error}\n")
        return USAGE
    level = logging.DEBUG if flags["verbose"] else logging.INFO
    logging.basicConfig(stream=sys.stderr, level=level, format=f"{name}: %(levelname)s: %(message)s")
    with _signals() as stop:
        return _serve(manifest, folder, build, flags, clock, stop)


class _Stop:
    requested = False

    def __call__(self) -> bool:
        return self.requested

    def request(self, _number: int, _frame: FrameType | None) -> None:
        self.requested = True


@contextmanager
def _signals() -> Iterator[_Stop]:
    stop = _Stop()
    old = {number: signal.signal(number, stop.request) for number in (signal.SIGTERM, signal.SIGINT)}
    try:
        yield stop
    finally:
        for number, handler in old.items():
            signal.signal(number, handler)


def _serve(
    manifest: Mapping[str, Any], folder: Path, build: Build, flags: Flags, clock: Clock | None, stop: _Stop
) -> int:
    name = manifest["name"]
    role = os.environ.get("DODO_SERVICE") or name
    ready = Path(os.environ.get("DODO_READY_FILE") or f"/tmp/dodo-ready-{role}")
    code = USAGE
    try:
        ready.unlink(missing_ok=True)  # left by one that was killed
        with ExitStack() as resources:
            session = resources.enter_context(_session(flags["cid"]))
            world = World.load(session.messages)
            resources.enter_context(published(session, flags["log-id"]))
            key = take_key()
            clock = clock or _clock(session, role, key)
            on_rig = bool(os.environ.get("DODO_RIG"))
            service = build(Context(name, flags, session.messages, resources, clock, session, key, on_rig))
            code = BROKEN
            if world and (service.drive or not os.environ.get("DODO_CLOCK")):
                session.hear_directly()
            members = resources.enter_context(_membership(session, role, key, world))
            loop = Loop(role, service, session, clock, flags["id"], members)
            resources.enter_context(_readiness(ready, session))
            try:
                (service.drive or loop.run)(stop)
            finally:
                if key or _recording():  # by hand nobody reads it
                    _print_record(service)
            if service.verdict is not None:
                if undeclared := undeclared_checks(service.verdict, manifest.get("checks")):
                    print(json.dumps({"dodo": "note", "text": undeclared}), flush=True)
                print(service.verdict.line(flags["cid"]), flush=True)
    except Exception as error:  # noqa: BLE001  (it is logged)
        if isinstance(error, MemoryTakenError):
            print(json.dumps({"dodo": "taken", "text": str(error)}), flush=True)
        expected = code == USAGE and isinstance(error, ValueError | OSError)
        crash.tell(error, folder, expected=expected, verbose=bool(flags["verbose"]))
        return code if expected else BROKEN
    return DONE


def _print_record(service: Service) -> None:
    """What an evaluator judged, as far as it came; without a verdict, too."""
    if service.judged is not None:
        service.record()
        checks = service.verdict.checks if service.verdict else ()
        for line in service.judged.lines({check.name: check.parameters for check in checks if check.parameters}):
            print(line, flush=True)


def _messages() -> MessageSet:
    """The standard messages and those of the test's own ODVD files."""
    return MessageSet.load(*(Path(p) for p in os.environ.get("DODO_ODVD", "").split(os.pathsep) if p))


def _recording() -> Path | None:
    """The recording that is judged, and that takes the place of the bus: with ``DODO_CLOCK=recording``."""
    return Path(os.environ["DODO_RECORDING"]) if os.environ.get("DODO_CLOCK") == "recording" else None


def _session(cid: int) -> Session:
    if _recording() is None:
        return Session(cid, _messages())
    from services.base.recorded.silent_session import SilentSession

    return SilentSession(cid, _messages())


def _clock(session: Session, role: str, key: bytes) -> Clock:
    """The test's clock, by ``DODO_CLOCK``."""
    if (recording := _recording()) is not None:
        from services.base.recorded.clock import clock_of

        return clock_of(recording, session, role)
    if os.environ.get("DODO_CLOCK") != "lockstep":
        return RealTimeClock()
    from services.base.lockstep.lockstep_clock import LockstepClock

    return LockstepClock(session, role, int(os.environ.get("DODO_READERS") or 1), key=key)


@contextmanager
def _membership(session: Session, role: str, key: bytes, world: World) -> Iterator[Members | None]:
    """The test's services in real time, as long as this is one of them; in lockstep the clock knows them."""
    senders = SenderTable.load(session.messages, key)
    if os.environ.get("DODO_CLOCK") or not (senders.by_message or world):
        yield None
        return
    members = Members(session, role, senders, world)
    members.join()
    yield members
    members.leave()


@contextmanager
def _readiness(file: Path, session: Session) -> Iterator[None]:
    """Report that the service is ready, and where it listens; the ready file exists as long as it is.

    Raises OSError for a link in its place: its folder may be the application's, too.
    """
    address = {"address": f"{session.address[0]}:{session.port}"} if session.hears_directly else {}
    os.close(os.open(file, os.O_WRONLY | os.O_CREAT | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC, 0o666))
    try:
        print(json.dumps({"dodo": "ready", **address}), flush=True)
        yield
    finally:
        file.unlink(missing_ok=True)
