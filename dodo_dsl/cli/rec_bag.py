"""Bags of ROS 2 in ``dodo rec`` and ``dodo new``: what becomes of each topic, and what is left out.

Topics of the application around here have its messages and names, others the usual ones of their types.
"""

import argparse
from collections.abc import Callable, Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, TextIO

import msgspec

from dodo_dsl import advice, atomic
from dodo_dsl.atomic import refuse_existing
from dodo_dsl.cli.display import progress_bar
from dodo_dsl.cli.errors import UsageError
from dodo_dsl.cli.rec_actions import RecJob, tell
from dodo_dsl.opendlv.message_set import MessageSet
from dodo_dsl.opendlv.ros_types import Topic
from dodo_dsl.rec import bag
from dodo_dsl.rec.recording_filter import NothingSelected
from dodo_dsl.spec.deployment import find_deployment
from dodo_dsl.terminal import printable

if TYPE_CHECKING:
    from dodo_dsl.opendlv.ros_messages import Types

FILES = (".mcap", ".db3")
_ENDINGS = {"mcap": ".mcap", "sqlite3": ".db3"}


def is_bag(path: Path) -> bool:
    """Whether a path is that of a bag, and not of a recording."""
    return path.is_dir() or path.suffix in FILES


def import_bag(options: argparse.Namespace, stdout: TextIO, stderr: TextIO) -> None:
    """Makes a recording of a bag."""
    path: Path = options.file
    output: Path = options.output or path.resolve().with_suffix(".rec")
    refuse_existing([output], options.force)
    with atomic.replacing(output, durable=True) as place:
        said = into(path, place, options.lossy, lambda text: tell(stderr, text), stderr)
    stdout.write(f"{output}: {said}")


def into(path: Path, place: Path, lossy: bool, problem: Callable[[str], None], stderr: TextIO) -> str:
    """Write the recording of a bag, and return what each of its topics became."""
    known, types = _of_application("a bag of ROS 2")
    from dodo_dsl.rec.bag_import import import_bag

    with (
        bag.opened(path) as found,
        progress_bar(stderr, f"reading {path.name}", sum(found.counts.values())) as progress,
    ):
        result = import_bag(found, place, lossy, known, types, progress)
    _tell_skipped(result.skipped, result.reasons, problem)
    lines = [f"{result.counts.total()} messages of {len(result.topics)} topics"]
    for each in result.topics.values():
        lines.append(f"  {each.topic} ({each.type}): {result.counts[each.topic]} -> {', '.join(each.bus)}")
    lines += [f"  {topic} ({type_}): {count} -> left out" for (topic, type_), count in result.left_out.items()]
    return _text(lines)


def export_bag(job: RecJob) -> None:
    """Makes a bag of a recording."""
    known, types = _of_application("--ros", job.messages)
    from dodo_dsl.rec.bag_export import BagExport

    folder, storage = job.folder(), job.options.storage
    refuse_existing([folder / "metadata.yaml", folder / f"{folder.name}{_ENDINGS[storage]}"], job.options.force)
    rows = job.rows()
    with (
        atomic.files_into(folder) as place,
        job.progress(f"writing {folder.name}", len(rows)) as progress,
        bag.written(place, folder.resolve().name, storage, types.store) as writer,
    ):
        result = BagExport(job.recording, types, writer, known)
        result.write(rows, progress)
        if not writer.counts:
            raise NothingSelected(f"{job.recording.path} has no message that has a type of ROS 2")
    _tell_skipped(result.skipped, result.reasons, job.tell)
    lines = [f"{folder}: {sum(writer.counts.values())} messages of {len(writer.counts)} topics"]
    lines += [f"  {topic} ({type_}): {count}" for (topic, type_), count in sorted(writer.counts.items())]
    for id_, count in sorted(result.left_out.items()):
        name = job.messages.name(id_) if id_ in job.messages.ids() else f"message {id_}"
        lines.append(f"  {name}: {count} -> left out")
    job.stdout.write(_text(lines))


def _text(lines: list[str]) -> str:
    return "".join(f"{printable(line)}\n" for line in lines)


def _of_application(what: str, messages: MessageSet | None = None) -> "tuple[list[Topic], Types]":
    """The topics of the application around here, with the messages that are written; and ROS types with its own."""
    if find_spec("rosbags") is None:
        raise UsageError(f"{what} needs rosbags: {advice.install('ros')}")
    from dodo_dsl import compiler
    from dodo_dsl.opendlv.ros_messages import Types

    if find_deployment(Path.cwd()) is None:
        return [], Types(messages=messages)
    checked = compiler.load([], services_only=True)
    declared = checked.application.declared.values() if checked.application else ()
    topics = {each.topic.topic: each for one in declared if one for each in one.topics}
    known = [
        msgspec.structs.replace(each.topic, bus=tuple(word for word, _ in each.messages if "." in word))
        for each in topics.values()
    ]
    deployment = checked.deployment
    return known, Types(deployment.ros_types, messages or MessageSet.load(*deployment.messages))


def _tell_skipped(skipped: Mapping[str, int], reasons: Mapping[str, str], problem: Callable[[str], None]) -> None:
    for topic, count in skipped.items():
        problem(f"skipped {count} message{'s' * (count != 1)} of {topic}: {reasons[topic]}")
