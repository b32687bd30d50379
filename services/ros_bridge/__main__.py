"""``python -m services.ros_bridge --cid=N --topics=JSON [--name=MEMORY...]``."""

import argparse
import sys
import tempfile
from pathlib import Path

import msgspec

from dodo_dsl.opendlv.ros_codec import RosTypeError, require_ros
from dodo_dsl.opendlv.ros_types import RosGraph
from dodo_dsl.opendlv.session import SessionError


def main(arguments: list[str]) -> str:
    """What is wrong; it does not return while all is well."""
    parser = argparse.ArgumentParser(prog="ros-bridge", allow_abbrev=False)
    parser.add_argument("--cid", type=int, required=True, help="of the test's bus")
    parser.add_argument("--topics", required=True, help="the RosGraph of the test, as JSON")
    parser.add_argument("--name", action="append", default=[], help="of each shared memory, in the topics' order")
    flags = parser.parse_args(arguments)
    try:
        require_ros()
        from services.ros_bridge.bridge import Bridge

        topics = msgspec.json.decode(flags.topics, type=RosGraph)
        with tempfile.TemporaryDirectory() as folder:
            bridge = Bridge(flags.cid, topics, Path(folder), flags.name)
        bridge.run()
    except msgspec.DecodeError as error:
        return f"--topics has no RosGraph: {error}"
    except (RosTypeError, SessionError, ValueError) as error:  # also of the graph, messages and their files
        return str(error)


if __name__ == "__main__":
    sys.exit(f"ros-bridge: {main(sys.argv[1:])}")
