"""Which program of an application got messages of another one and sent nothing, by the recording of its test."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from dodo_dsl.emit.output_folder import FILES
from dodo_dsl.opendlv.messages.message_set import MessageSet
from dodo_dsl.opendlv.recordings.recording import Recording
from dodo_dsl.plan.model import ApplicationService, Plan

Came = set[tuple[int, int]]
"""Ids and sender stamps of messages."""


def silent_consumer(plan: Plan, folder: Path, recording: Path) -> str:
    """The first such program in half a sentence, empty where there is none; ``folder`` is the compiled test's.

    Raises OSError, also for what is no recording, and OdvdError.
    """
    messages = MessageSet.load(*(folder / FILES / path for path in plan.messages))
    with Recording(recording) as recorded:
        came = set(map(tuple, np.unique(recorded.index[["data_type", "sender_stamp"]]).tolist()))
    services = plan.application.services
    for consumer in services:
        if consumer.outputs and not any(_is_among(came, message, messages) for message in consumer.outputs):
            for message in consumer.inputs:
                producer = _producer(message, [s for s in services if s is not consumer])
                if producer and _is_among(came, message, messages):
                    return f"{message} came from '{producer}', but '{consumer.name}', which consumes it, sent nothing"
    return ""


def _producer(message: str, services: Sequence[ApplicationService]) -> str:
    """The service that declares a message, under any sender stamp where one of both names none; empty if none does."""
    name, _, stamp = message.partition("/")
    for service in services:
        for output in service.outputs:
            its_name, _, its_stamp = output.partition("/")
            if its_name == name and (its_stamp == stamp or not its_stamp or not stamp):
                return service.name
    return ""


def _is_among(came: Came, message: str, messages: MessageSet) -> bool:
    name, _, stamp = message.partition("/")
    if name not in messages.names():
        return False
    return any(id_ == messages.id(name) and (not stamp or int(stamp) == its_stamp) for id_, its_stamp in came)
