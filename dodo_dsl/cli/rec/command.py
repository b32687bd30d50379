"""dodo rec: look into recordings, cut them, export them."""

import argparse
import math
from pathlib import Path
from typing import TextIO

from dodo_dsl.cli.errors import files_of_the_user
from dodo_dsl.cli.exits import Exit

EXAMPLES = """examples:
  dodo rec info drive.rec                                         messages, rates, gaps, frames, damage
  dodo rec cut drive.rec -o curve.rec --start 4 --end 9.5         a stretch of time, in seconds since the begin
  dodo rec cut drive.rec -o front.rec --message opendlv.proxy.DistanceReading/0
  dodo rec export drive.rec --csv -o tables                       as cluon-rec2csv does
  dodo rec export drive.rec --coco -o labelled                    frames with their detections, as a data set
"""
_CUT = """examples:
  dodo rec cut drive.rec -o curve.rec --start 4 --end 9.5
  dodo rec cut drive.rec -o front.rec --message opendlv.proxy.DistanceReading/0 --message 1090
"""
_EXPORT = """examples:
  dodo rec export drive.rec --csv -o tables
  dodo rec export old.rec --csv -o tables --messages 0.9 --messages own.odvd
  dodo rec export drive.rec --coco -o labelled --labels 3 --pictures jpg
  dodo rec export desk.rec --coco -o labelled --truth desk.json
"""
_INFO = """examples:
  dodo rec info drive.rec
  dodo rec info drive.rec --json --no-decode
"""


def add(parser: argparse.ArgumentParser) -> None:
    actions = parser.add_subparsers(dest="action", metavar="ACTION", required=True)
    info = _action(actions, "info", "messages, rates, gaps, frames and damage of a recording", _INFO)
    info.add_argument("--json", action="store_true", help="as JSON")
    info.add_argument("--no-decode", action="store_true", help="count camera frames, but do not decode them")
    cut = _action(actions, "cut", "a part of a recording as a recording of its own, byte for byte", _CUT)
    cut.add_argument("-o", "--output", metavar="FILE", type=Path, required=True, help="the new recording")
    export = _action(actions, "export", "a recording as tables or as a labelled data set", _EXPORT)
    what = export.add_mutually_exclusive_group(required=True)
    what.add_argument("--csv", action="store_true", help="a file for each message and sender stamp")
    what.add_argument("--coco", action="store_true", help="pictures with the boxes of the detections in the recording")
    export.add_argument("-o", "--output", metavar="DIR", type=Path, help="default: the recording's name without .rec")
    export.add_argument("--pictures", choices=("png", "jpg"), default="png", help="file type of --coco (default: png)")
    export.add_argument(
        "--camera", metavar="N", type=int, help="sender stamp of the frames of --coco, if there are more"
    )
    export.add_argument(
        "--labels", metavar="N", type=int, help="sender stamp of the detections of --coco (default: all)"
    )
    export.add_argument(
        "--truth", metavar="FILE.json", type=Path, help="take the boxes of --coco from a truth file, for every frame"
    )
    export.add_argument("--all", action="store_true", help="with --coco: also frames without a detection")
    for action in (cut, export):
        _selection(action)


def _action(
    actions: "argparse._SubParsersAction[argparse.ArgumentParser]", name: str, text: str, examples: str
) -> argparse.ArgumentParser:
    action = actions.add_parser(
        name, help=text, description=text, epilog=examples, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    action.add_argument("file", metavar="FILE.rec", type=Path)
    action.add_argument(
        "--messages",
        metavar="SET",
        action="append",
        default=[],
        help="message set 0.9 or 1.0 (default: what fits the content), or an .odvd file beside dodo.yml's; repeatable",
    )
    return action


def _selection(action: argparse.ArgumentParser) -> None:
    action.add_argument("--start", metavar="S", type=_seconds, help="first time, seconds since the begin or since 1970")
    action.add_argument("--end", metavar="S", type=_seconds, help="time to end before")
    action.add_argument(
        "--message",
        metavar="M",
        action="append",
        default=[],
        help="name or id, with /senderStamp for one sender; repeatable (default: all)",
    )
    action.add_argument("--force", action="store_true", help="replace what is there")


def _seconds(text: str) -> float:
    try:
        value = float(text.removesuffix("s"))
    except ValueError:
        value = math.nan
    if not math.isfinite(value) or value < 0:
        raise argparse.ArgumentTypeError(f"expected seconds, for example 2.5, not `{text}`")
    return value


def main(options: argparse.Namespace, stdout: TextIO, stderr: TextIO) -> int:
    from dodo_dsl.cli.rec import actions

    with files_of_the_user():
        actions.run(options, stdout, stderr)
    return Exit.OK
