"""``python -m services.ros_bridge --cid=N --topics=JSON [--name=MEMORY...]``."""

import argparse
import sys
import tempfile
from pathlib import Path

import msgspec

from dodo_dsl.opendlv.message_set import MessageError
from dodo_dsl.opendlv.odvd import OdvdError
from dodo_dsl.opendlv.ros_messages import RosTypeError, require_ros
from dodo_dsl.opendlv.ros_types import RosGraph
from dodo_dsl.opendlv.session import Session, SessionError


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(prog="ros-bridge", allow_abbrev=False)
    parser.add_argument("--cid", type=int, required=True, help="of the test's bus")
    parser.add_argument("--topics", required=True, help="the RosGraph of the test, as JSON")
    parser.add_argument("--name", action="append", default=[], help="of each shared memory, in the topics' order")
    flags = parser.parse_args(arguments)
    try:
        require_ros()
        from services.ros_bridge.bridge import Bridge, BridgeError, definitions
        from services.ros_bridge.graph import Graph, GraphError
    except RosTypeError as error:
        return _broken(str(error))
    try:
        topics = msgspec.json.decode(flags.topics, type=RosGraph)
        with tempfile.TemporaryDirectory() as folder:
            messages, types = definitions(topics, Path(folder))
            session = Session(flags.cid, messages)
            bridge = Bridge(session, Graph(), topics, types, flags.name)
        with session:
            bridge.run()
    except msgspec.DecodeError as error:
        return _broken(f"--topics is no graph: {error}")
    except (BridgeError, GraphError, MessageError, OdvdError, RosTypeError, SessionError) as error:
        return _broken(str(error))


def _broken(text: str) -> int:
    print(f"ros-bridge: {text}", file=sys.stderr, flush=True)
    return 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
