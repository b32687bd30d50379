"""A service as a process: flags, log, signals, readiness, and its exit code."""

import logging
import os
import signal
import stat
import sys
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, ExitStack, contextmanager
from pathlib import Path
from typing import Any, NoReturn

from google.protobuf.message import Message

from dodo_dsl.opendlv import address_book
from dodo_dsl.opendlv.address import is_of_the_world
from dodo_dsl.opendlv.message_set import MessageSet
from dodo_dsl.opendlv.session import Session
from dodo_dsl.opendlv.shared_memory import MemoryTakenError
from services.base.clock import Clock, RealTimeClock
from services.base.flags import Flags, FlagsError, load_manifest, parse
from services.base.loop import Loop
from services.base.members import Members, SenderTable, World, channel
from services.base.runner import connect, say, tell
from services.base.service import Build, Context, Service

_OURS = ("dodo_dsl.", "services.")
_BASE = Path(__file__).resolve().parent


def _log_end(error: Exception, *, expected: bool) -> None:
    """Logs the error; the last line is one sentence. ``expected`` means that its own text is one for users."""
    if not expected and not type(error).__module__.startswith(_OURS):
        logging.error("it ended by an error", exc_info=error)
    text = _unknown_field(error) or " ".join(str(error).split())
    logging.critical("%s", text if expected else f"{type(error).__name__}: {text}")


def _unknown_field(error: Exception) -> str:
    """What is wrong where a message has no field of the name that was read; empty for anything else."""
    if not isinstance(error, AttributeError) or not isinstance(error.obj, Message):
        return ""
    about = error.obj.DESCRIPTOR
    fields = ", ".join(field.name for field in about.fields)
    return f"{about.full_name} has no field '{error.name}'; it has {fields or 'no fields'}"


DONE, BROKEN, USAGE = 0, 1, 2


def run(folder: Path, build: Build, clock: Clock | None = None) -> int:
    """A service from its command line to its exit code: 0 done or stopped by a signal, 1 broken, 2 wrong flags.

    ``folder`` holds the manifest; ``build`` raises ValueError or OSError for unusable flags.
    """
    manifest = load_manifest(folder)
    name = manifest["name"]
    try:
        flags = parse(manifest, sys.argv[1:])
    except FlagsError as error:
        sys.stderr.write(f"{name}: {error}\n")
        return USAGE
    level = logging.DEBUG if flags["verbose"] else logging.INFO
    logging.basicConfig(stream=sys.stderr, level=level, format=f"{name}: %(levelname)s: %(message)s")
    role = os.environ.get("DODO_SERVICE") or name
    signals: list[int] = []
    connect(channel(), role)
    with _handled(lambda number, _: signals.append(number)):
        return _serve(role, manifest, folder, build, flags, clock, lambda: bool(signals))


def main(file: str, build: Build, clock: Clock | None = None) -> NoReturn:
    """The program of the service whose ``__main__.py`` this file is."""
    sys.exit(run(Path(file).parent, build, clock))


def interruptible() -> AbstractContextManager[None]:
    """A signal ends the service at once with code 0, and closes its resources; only in the main thread."""
    return _handled(lambda *_: sys.exit(0))


@contextmanager
def _handled(handler: Callable[[int, object], None]) -> Iterator[None]:
    old = {number: signal.signal(number, handler) for number in (signal.SIGTERM, signal.SIGINT)}
    try:
        yield
    finally:
        for number, before in old.items():
            signal.signal(number, before)


def _serve(
    role: str,
    manifest: Mapping[str, Any],
    folder: Path,
    build: Build,
    flags: Flags,
    clock: Clock | None,
    stop: Callable[[], bool],
) -> int:
    code = USAGE
    try:
        place = channel()
        if place:
            address_book.remove(place, role)  # of one that was killed
        with ExitStack() as resources:
            messages = _messages(manifest, folder)
            with interruptible():  # it may wait for the clock service
                if stop():
                    return DONE
                session, clock = _bus_and_clock(flags["cid"], messages, role, resources, clock)
            on_rig = bool(os.environ.get("DODO_RIG"))
            service = build(Context(manifest["name"], flags, messages, resources, clock, session, on_rig))
            members = _membership(session, role)
            stamp = flags["id"] if isinstance(flags["id"], int) else 0  # its own list gives each message one
            loop = Loop(role, service, session, clock, stamp, members, bool(flags["ends-input"]))
            code = BROKEN
            if place and (service.drive or service.observe or not os.environ.get("DODO_CLOCK")):
                session.hear_directly()
            if place:
                address_book.enter(place, role, session.address)
                resources.callback(address_book.leave, place, role, session.address)
            tell("ready")
            try:
                (service.drive or loop.run)(stop)
            finally:
                if place:  # by hand nobody reads it
                    _print_record(service)
            if service.verdict is not None:
                say(service.verdict.line())
    except Exception as error:  # noqa: BLE001  (it is logged)
        if isinstance(error, MemoryTakenError):
            tell("taken", text=str(error))
        expected = code == USAGE and isinstance(error, ValueError | OSError)
        _log_end(error, expected=expected)
        return code if expected else BROKEN
    return DONE


def _print_record(service: Service) -> None:
    if service.judged is not None:
        service.record()
        checks = service.verdict.checks if service.verdict else ()
        for line in service.judged.lines({check.name: check.parameters for check in checks if check.parameters}):
            say(line)


def _messages(manifest: Mapping[str, Any], folder: Path) -> MessageSet:
    """The standard messages and those of the test's own ODVD files, which replace none that DoDo's services name."""
    own = (Path(p) for p in os.environ.get("DODO_ODVD", "").split(os.pathsep) if p)
    choices = [each.get("choices") for each in manifest.get("parameters", {}).values()]
    named = str([manifest.get("messages"), choices] * (folder.resolve().parent == _BASE.parent))
    kept = {name for name in MessageSet.standard().names() if is_of_the_world(name) or name in named}
    return MessageSet.load(*own, kept=kept)


def _bus_and_clock(
    cid: int, messages: MessageSet, role: str, resources: ExitStack, clock: Clock | None
) -> tuple[Session, Clock]:
    """With ``DODO_CLOCK=recording``, a recording that is judged takes the place of the bus."""
    kind = os.environ.get("DODO_CLOCK")
    if kind == "recording":
        from services.base.recorded_clock import SilentSession, clock_of

        silent = SilentSession(cid, messages)
        return silent, clock_of(Path(os.environ["DODO_RECORDING"]), silent, role)
    session = resources.enter_context(Session(cid, messages))
    if clock or kind != "lockstep":
        return session, clock or RealTimeClock()
    from services.base.lockstep_clock import LockstepClock

    return session, LockstepClock(session, role, int(os.environ.get("DODO_READERS") or 1))


def _membership(session: Session, role: str) -> Members | None:
    """The test's services in real time; in lockstep the clock knows them."""
    senders, world = SenderTable(session.messages), World(session.messages)
    if os.environ.get("DODO_CLOCK") or not (senders.by_message or world.names):
        return None
    return Members(session, role, senders, world)


def stop_without_master() -> None:
    """From now on the end of standard input, where it is a pipe, is a SIGTERM: the process that held it has ended."""
    if stat.S_ISFIFO(os.fstat(0).st_mode):
        threading.Thread(target=_await_end, daemon=True).start()


def _await_end() -> None:
    while os.read(0, 4096):
        pass
    os.kill(os.getpid(), signal.SIGTERM)
