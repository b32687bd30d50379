"""A ROS 2 node with the endpoints that a test asks for: ``peer.py NAME ENDPOINTS``; what it hears is printed as JSON.

An endpoint has ``topic`` and ``type``, and ``reliable`` and ``durable`` where it has not the usual quality. A publisher
has ``fields``, by their paths, and is sent ten times a second, stamped ``age`` seconds ago.
"""

import contextlib
import importlib
import json
import sys
from typing import Any

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.time import Duration


def plain(message: Any) -> Any:
    """A message as JSON has it; long lists as length, first and last."""
    if hasattr(message, "get_fields_and_field_types"):
        return {name: plain(getattr(message, name)) for name in message.get_fields_and_field_types()}
    if isinstance(message, (str, bool, int, float)):
        return message
    if len(message) > 40:
        return [len(message), message[0], message[-1]]
    return [plain(each) if hasattr(each, "get_fields_and_field_types") else float(each) for each in message]


class Peer(Node):
    def __init__(self, name: str, endpoints: list[dict[str, Any]]) -> None:
        simulated = [rclpy.Parameter("use_sim_time", value=True)] if name.startswith("simulated") else []
        super().__init__(name, parameter_overrides=simulated)
        for endpoint in endpoints:
            package, kind, type_ = endpoint["type"].split("/")
            message = getattr(importlib.import_module(f"{package}.{kind}"), type_)
            qos = QoSProfile(depth=10)
            if not endpoint.get("reliable", True):
                qos.reliability = ReliabilityPolicy.BEST_EFFORT
            if endpoint.get("durable"):
                qos.durability = DurabilityPolicy.TRANSIENT_LOCAL
            if "fields" in endpoint:
                out = self.create_publisher(message, endpoint["topic"], qos)
                self.create_timer(0.1, lambda e=endpoint, m=message, o=out: self.say(e, m(), o))
            else:
                self.create_subscription(message, endpoint["topic"], lambda m, e=endpoint: self.hear(e, m), qos)

    def hear(self, endpoint: dict[str, Any], message: Any) -> None:
        now = self.get_clock().now().nanoseconds
        print(json.dumps({"topic": endpoint["topic"], "now": now, "message": plain(message)}), flush=True)

    def say(self, endpoint: dict[str, Any], message: Any, out: Any) -> None:
        if "age" in endpoint:
            message.header.stamp = (self.get_clock().now() - Duration(seconds=endpoint["age"])).to_msg()
        for path, value in endpoint["fields"].items():
            *above, last = path.split(".")
            at = message
            for name in above:
                at = getattr(at, name)
            setattr(at, last, float(value) if value == "nan" else value)  # which JSON has not
        out.publish(message)


rclpy.init()
with contextlib.suppress(KeyboardInterrupt, ExternalShutdownException):
    peer = Peer(sys.argv[1], json.loads(sys.argv[2]))
    print(json.dumps({"node": sys.argv[1]}), flush=True)
    rclpy.spin(peer)
