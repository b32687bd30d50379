"""dodo rec: inspect, cut, export and import recordings."""

import argparse
from pathlib import Path
from typing import TextIO

from dodo_dsl.cli import numbers
from dodo_dsl.cli.errors import Exit, files_of_the_user

EXAMPLES = """examples:
  dodo rec info drive.rec                                         messages, rates, gaps, frames, damage
  dodo rec cut drive.rec -o curve.rec --start 4 --end 9.5         a time range, in seconds since the start
  dodo rec cut drive.rec -o front.rec --message opendlv.proxy.DistanceReading/0
  dodo rec export drive.rec --csv -o tables                       the same as cluon-rec2csv
  dodo rec export drive.rec --coco -o labelled                    frames and detections as a data set
  dodo rec export desk.rec --coco -o labelled --truth desk.json   frames and the boxes of a truth file
  dodo rec export drive.rec old.rec --coco -o set --validation 50%      one set of several recordings
  dodo rec export old.rec --csv -o tables --messages 0.9 --messages own.odvd
  dodo rec export drive.rec --frames -o pictures --pictures jpg   what the camera saw
  dodo rec export drive.rec --video -o drive.mp4 --camera 0       the same as a video
  dodo rec export drive.rec --mcap -o drive.mcap                  for Foxglove, Lichtblick or rerun
  dodo rec export drive.rec --ros -o bag                          a bag of ROS 2, for RViz and others
  dodo rec import recorded -o drive-1.rec                         a recording of a bag, by the types of its topics
"""
_FORMATS = {
    "csv": "write one table per message and sender stamp",
    "coco": "write frames with the boxes of the detections",
    "frames": "write the camera's frames as images, named by sender stamp and sample time",
    "video": "write the camera's frames into an MP4 of h264",
    "mcap": "write an MCAP file for Foxglove, Lichtblick or rerun (needs DoDo's extra 'mcap')",
    "ros": "write a bag of ROS 2, a topic for each message that has a type there (needs DoDo's extra 'ros')",
}


_ACTIONS = {
    "info": "show messages, rates, gaps, frames and damage of a recording",
    "cut": "copy a part of a recording into a new one, byte for byte",
    "export": "export a recording for other tools",
    "import": "make a recording of a bag of ROS 2, by the types of its topics (needs DoDo's extra 'ros')",
}


def add(parser: argparse.ArgumentParser) -> None:
    actions = parser.add_subparsers(dest="action", metavar="ACTION", required=True)
    info, cut, export, bag = (actions.add_parser(name, help=text, description=text) for name, text in _ACTIONS.items())
    for action in (info, cut):
        action.add_argument("file", metavar="FILE.rec", type=Path)
    export.add_argument("files", metavar="FILE.rec", type=Path, nargs="+", help="--coco takes several")
    bag.add_argument("file", metavar="BAG", type=Path, help="folder of rosbag2, or its .mcap or .db3")
    for action in (info, cut, export):
        action.add_argument(
            "--messages", metavar="SET", action="append", default=[],
            help="message set 0.9 or 1.0 (default: detected from the content), or an additional .odvd file; repeatable",
        )  # fmt: skip
    info.add_argument("--json", action="store_true", help="output as JSON")
    info.add_argument("--no-decode", action="store_true", help="count camera frames without decoding them")
    cut.add_argument("-o", "--output", metavar="FILE", type=Path, required=True, help="new recording")
    text = "new recording (default: the bag's name with .rec)"
    bag.add_argument("-o", "--output", metavar="FILE", type=Path, help=text)
    text = "smaller pictures, which look the same but are not; JPEG stays as it is"
    bag.add_argument("--lossy", action="store_true", help=text)
    _add_export(export)
    for action in (cut, export):
        text = "start time, in seconds since the recording's start or since 1970"
        action.add_argument("--start", metavar="S", type=_seconds, help=text)
        action.add_argument("--end", metavar="S", type=_seconds, help="end time (exclusive), as --start")
        text = "message by name or id, with /senderStamp for one sender; repeatable (default: all)"
        action.add_argument("--message", metavar="M", action="append", default=[], help=text)
    for action in (cut, export, bag):
        action.add_argument("--force", action="store_true", help="replace existing files")


def _add_export(export: argparse.ArgumentParser) -> None:
    what = export.add_mutually_exclusive_group(required=True)
    for name, text in _FORMATS.items():
        what.add_argument(f"--{name}", dest="format", action="store_const", const=name, help=text)
    text = "output folder or file (default: the recording's name with another ending)"
    export.add_argument("-o", "--output", metavar="PATH", type=Path, help=text)
    text = "file type for --coco and --frames (default: png)"
    export.add_argument("--pictures", choices=("png", "jpg"), default="png", help=text)
    text = "sender stamp of the camera, if there are several"
    export.add_argument("--camera", metavar="N", type=numbers.seed, help=text)
    text = "sender stamp of the detections for --coco (default: all)"
    export.add_argument("--labels", metavar="N", type=numbers.seed, help=text)
    text = "truth file with the boxes for --coco, the same for every frame"
    export.add_argument("--truth", metavar="FILE.json", type=Path, help=text)
    text = "with --coco: folders train and validation, the latter with this share of the recordings"
    export.add_argument("--validation", metavar="SHARE", type=_share, default=0.0, help=text)
    export.add_argument("--seed", metavar="N", type=numbers.seed, default=0, help="chooses those recordings")


def _seconds(text: str) -> float:
    return numbers.patience(text.removesuffix("s"))


def _share(text: str) -> float:
    try:
        share = float(text.removesuffix("%")) / (100 if text.endswith("%") else 1)
    except ValueError:
        share = 0
    if not 0 < share < 1:
        raise argparse.ArgumentTypeError(f"'{text}' is not a share, expected for example 20%")
    return share


def main(options: argparse.Namespace, stdout: TextIO, stderr: TextIO) -> int:
    from dodo_dsl.cli import rec_actions

    with files_of_the_user():
        rec_actions.run(options, stdout, stderr)
    return Exit.OK
