"""Bags of ROS 2 in ``dodo rec`` and ``dodo new``: what became of each topic, and what was left out."""

import argparse
from collections.abc import Callable, Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import TextIO

from dodo_dsl import advice, atomic
from dodo_dsl.atomic import refuse_existing
from dodo_dsl.cli.display import progress_bar
from dodo_dsl.cli.errors import UsageError
from dodo_dsl.cli.rec_actions import RecJob, tell
from dodo_dsl.rec import bag
from dodo_dsl.rec.recording_filter import NothingSelected

FILES = (".mcap", ".db3")


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
    _require_rosbags("a bag of ROS 2")
    from dodo_dsl.rec.bag_import import import_bag

    with (
        bag.opened(path) as found,
        progress_bar(stderr, f"reading {path.name}", sum(found.counts.values())) as progress,
    ):
        result = import_bag(found, path, place, lossy, progress)
    _tell_skipped(result.skipped, result.reasons, problem)
    lines = [f"{result.counts.total()} messages of {len(result.topics)} topics\n"]
    for each in result.topics.values():
        lines.append(f"  {each.topic} ({each.type}): {result.counts[each.topic]} -> {', '.join(each.bus)}\n")
    lines += [f"  {topic} ({type_}): {count} -> left out\n" for (topic, type_), count in result.left_out.items()]
    return "".join(lines)


def export_bag(job: RecJob) -> None:
    """Makes a bag of a recording."""
    _require_rosbags("--ros")
    from dodo_dsl.opendlv.ros_messages import Types
    from dodo_dsl.rec.bag_export import BagExport

    folder, storage, types = job.folder(), job.options.storage, Types(messages=job.messages)
    ending = {"mcap": ".mcap", "sqlite3": ".db3"}[storage]
    refuse_existing([folder / "metadata.yaml", folder / f"{folder.name}{ending}"], job.options.force)
    rows = job.rows()
    with (
        atomic.files_into(folder) as place,
        job.progress(f"writing {folder.name}", len(rows)) as progress,
        bag.written(place, folder.resolve().name, storage, types.store) as writer,
    ):
        result = BagExport(job.recording, job.messages, types, writer)
        result.write(rows, progress)
        if not writer.counts:
            raise NothingSelected(f"{job.recording.path} has no message that has a type of ROS 2")
    _tell_skipped(result.skipped, result.reasons, job.tell)
    lines = [f"{folder}: {sum(writer.counts.values())} messages of {len(writer.counts)} topics\n"]
    lines += [f"  {topic} ({type_}): {count}\n" for (topic, type_), count in sorted(writer.counts.items())]
    for id_, count in sorted(result.left_out.items()):
        name = job.messages.name(id_) if id_ in job.messages.ids() else f"message {id_}"
        lines.append(f"  {name}: {count} -> left out\n")
    job.stdout.write("".join(lines))


def _require_rosbags(what: str) -> None:
    if find_spec("rosbags") is None:
        raise UsageError(f"{what} needs rosbags: {advice.install('ros')}")


def _messages(count: int) -> str:
    return f"{count} message{'s' * (count != 1)}"


def _tell_skipped(skipped: Mapping[str, int], reasons: Mapping[str, str], problem: Callable[[str], None]) -> None:
    for topic, count in skipped.items():
        problem(f"skipped {_messages(count)} of {topic}: {reasons[topic]}")
