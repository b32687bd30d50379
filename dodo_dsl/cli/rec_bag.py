"""Bags of ROS 2 in ``dodo rec``: what becomes of each topic, and what is left out."""

import argparse
from collections.abc import Callable, Iterable
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, TextIO

from msgspec.structs import replace

from dodo_dsl import advice, atomic
from dodo_dsl.atomic import refuse_existing
from dodo_dsl.cli.errors import UsageError
from dodo_dsl.cli.rec_actions import RecJob, tell
from dodo_dsl.opendlv.message_set import MessageSet
from dodo_dsl.opendlv.ros_types import Topic
from dodo_dsl.rec import bag
from dodo_dsl.spec.deployment import find_deployment
from dodo_dsl.terminal import printable

if TYPE_CHECKING:
    from dodo_dsl.opendlv.ros_messages import Types
    from dodo_dsl.rec.bag_export import BagExport
    from dodo_dsl.rec.bag_import import BagImport


def import_bag(options: argparse.Namespace, stdout: TextIO, stderr: TextIO) -> None:
    """Makes a recording of a bag, and says what each of its topics became.

    Topics of the application around here have its messages, others the usual ones of their types.
    """
    _require_rosbags("a bag of ROS 2")
    from dodo_dsl.rec.bag_import import BagImport

    path: Path = options.file
    output: Path = options.output or path.resolve().with_suffix(".rec")
    refuse_existing([output], options.force)
    known, types = _of_application()
    with atomic.replacing(output, durable=True) as place, bag.opened(path) as found:
        result = BagImport(found, types, known, options.lossy)
        result.write(place)
    lines = [
        f"{each.topic} ({each.type}): {result.counts[each.topic]} -> {', '.join(each.bus)}"
        for each in result.topics.values()
    ]
    lines += [f"{topic} ({type_}): {count} -> left out" for (topic, type_), count in result.left_out.items()]
    text = f"{output}: {result.counts.total()} messages of {len(result.topics)} topics"
    stdout.write(_told(text, lines, result, lambda said: tell(stderr, said)))


def export_bag(job: RecJob) -> None:
    """Makes a bag of a recording."""
    _require_rosbags("--ros")
    from dodo_dsl.opendlv.ros_messages import Types
    from dodo_dsl.rec.bag_export import BagExport

    folder = job.folder()
    refuse_existing([folder / "metadata.yaml", folder / f"{folder.name}.mcap"], job.options.force)
    rows = job.rows()
    with atomic.files_into(folder) as place, bag.written(place, folder.resolve().name) as writer:
        result = BagExport(job.recording, Types(messages=job.messages), writer)
        result.write(rows)
        if not result.counts:
            raise UsageError(f"{job.recording.path} has no message that has a type of ROS 2")
    lines = [f"{topic} ({type_}): {count}" for (topic, type_), count in sorted(result.counts.items())]
    for id_, count in sorted(result.left_out.items()):
        name = job.messages.name(id_) if id_ in job.messages.ids() else f"message {id_}"
        lines.append(f"{name}: {count} -> left out")
    text = f"{folder}: {result.counts.total()} messages of {len(result.counts)} topics"
    job.stdout.write(_told(text, lines, result, job.tell))


def _told(text: str, lines: Iterable[str], result: "BagImport | BagExport", problem: Callable[[str], None]) -> str:
    for topic, count in result.skipped.items():
        problem(f"skipped {count} message{'s' * (count != 1)} of {topic}: {result.reasons[topic]}")
    return "\n  ".join(map(printable, (text, *lines))) + "\n"


def _require_rosbags(what: str) -> None:
    if find_spec("rosbags") is None:
        raise UsageError(f"{what} needs rosbags: {advice.install('ros')}")


def _of_application() -> "tuple[list[Topic], Types]":
    """The topics of the application around here, with the messages that are written; and ROS types with its own."""
    from dodo_dsl import compiler
    from dodo_dsl.opendlv.ros_messages import Types

    if find_deployment(Path.cwd()) is None:
        return [], Types()
    checked = compiler.load([], services_only=True)
    declared = checked.application.declared.values() if checked.application else ()
    topics = {each.topic.topic: each for one in declared if one for each in one.topics}
    known = [
        replace(each.topic, bus=tuple(word for word, _ in each.messages if "." in word)) for each in topics.values()
    ]
    return known, Types(checked.deployment.ros_types, MessageSet.load(*checked.deployment.messages))
