"""Services in this process, as their command line builds them: no bus, and time as the test says."""

import importlib
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any

from dodo_dsl.opendlv.message_set import MessageSet
from services.base import Context, UnusableMessageError
from services.base.flags import load_manifest, parse
from tests.services.process import ROOT

MESSAGES = MessageSet.standard()


@contextmanager
def built(module: str, *flags: str) -> Iterator[Any]:
    """The service of `services.<module>`; what it holds is let go at the end. Raises what its `build` raises."""
    manifest = load_manifest(ROOT / "services" / module)
    context = Context(manifest["name"], parse(manifest, ["--cid=128", *flags]), MESSAGES)
    with context.resources:
        yield importlib.import_module(f"services.{module}.service").build(context)


def refusal(module: str, *flags: str) -> str:
    """Why a service cannot be built: the sentence with which its process ends."""
    try:
        with built(module, *flags):
            pass
    except (ValueError, OSError, RuntimeError) as error:
        return " ".join(str(error).split())
    raise AssertionError(f"{module} was built")


def hand(service: Any, name: str, time: int = 0, sender_stamp: int | None = None, **fields: Any) -> None:
    """Give a service a message, as its loop does."""
    with suppress(UnusableMessageError):
        service.inputs[name, sender_stamp](MESSAGES.type(name)(**fields), time)


def hide(service: Any, due: int, until: int, number: int = 0, sampled: int = 0, sampled_until: int = 0) -> None:
    """Tell an evaluator of a frame that was due, in us of the test, and not shown, and until when nothing is."""
    sampled, sampled_until = sampled or due, sampled_until or until
    fields = {"number": number, "sampled": sampled, "sampledUntil": sampled_until, "dueUntil": until}
    service.not_shown(MESSAGES.type("dodo.NotShown")(**fields), due)
