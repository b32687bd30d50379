"""Run by a Python with ROS 2: reads messages of JSON lines as [type, hex], and writes their fields and bytes again."""

import importlib
import json
import sys

from rclpy.serialization import deserialize_message, serialize_message


def fields(value):
    if hasattr(value, "get_fields_and_field_types"):
        return {name: fields(getattr(value, name)) for name in value.get_fields_and_field_types()}
    if isinstance(value, (str, bool, int, float)):
        return value
    return [fields(each) for each in (value.tolist() if hasattr(value, "tolist") else value)]


for line in sys.stdin:
    type_, data = json.loads(line)
    package, _, name = type_.split("/")
    try:
        kind = getattr(importlib.import_module(f"{package}.msg"), name)
    except ImportError:
        print(json.dumps(None))
        continue
    message = deserialize_message(bytes.fromhex(data), kind)
    print(json.dumps([fields(message), serialize_message(message).hex()]))
