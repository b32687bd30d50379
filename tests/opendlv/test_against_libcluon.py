"""Every message of ours, written by us and read by libcluon's own tool."""

import base64
import csv
import random
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from dodo_dsl.opendlv.bus.envelope import Envelope, encode_frame
from dodo_dsl.opendlv.messages.message_set import MessageSet
from dodo_dsl.opendlv.odvd import STANDARD
from dodo_dsl.opendlv.odvd.parser import Field, load

MESSAGES = MessageSet.standard()
REC2CSV = Path(sys.executable).with_name("cluon-rec2csv")


def some_value(field: Field, rng: random.Random) -> Any:
    if field.type == "string":
        return rng.choice(["", "yellow", "h264 äö"])
    if field.type == "bytes":
        return rng.randbytes(rng.randrange(9))
    if field.type == "bool":
        return rng.random() < 0.5
    if field.type in ("float", "double"):
        return rng.randrange(-80_000, 80_000) / 8
    bits = int(field.type.removeprefix("u").removeprefix("int"))
    return rng.randrange(2**bits) if field.type.startswith("u") else rng.randrange(-(2 ** (bits - 1)), 2 ** (bits - 1))


def same(written: str, value: Any) -> bool:
    if isinstance(value, float):
        return float(written) == pytest.approx(value, rel=1e-5)
    if isinstance(value, int):
        return int(written) == value
    return base64.b64decode(written) == (value if isinstance(value, bytes) else value.encode())


def test_every_message_is_read_by_libcluon(tmp_path: Path) -> None:
    pytest.importorskip("pycluon")
    rng = random.Random(2900)
    expected: dict[str, dict[str, Any]] = {}
    with (tmp_path / "all.rec").open("wb") as recording:
        for definition in load(STANDARD):
            values = {field.name: some_value(field, rng) for field in definition.fields}
            expected[definition.name] = values
            payload = MESSAGES.encode(MESSAGES.type(definition.id)(**values))
            recording.write(encode_frame(Envelope(definition.id, payload, 1_000_002, 0, -5, 3)))
    subprocess.run(
        [REC2CSV, "--rec=all.rec", f"--odvd={STANDARD}"], cwd=tmp_path, check=True, capture_output=True, timeout=60
    )
    for name, values in expected.items():
        with (tmp_path / f"{name}-3.csv").open() as file:
            (row,) = csv.DictReader(file, delimiter=";")
        assert (row["sent.seconds"], row["sent.microseconds"], row["sampleTimeStamp.microseconds"]) == ("1", "2", "-5")
        assert {key: value for key, value in values.items() if not same(row[key], value)} == {}, (name, row)
