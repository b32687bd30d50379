"""The messages of both sets, written by us and read by libcluon's own tools."""

import base64
import csv
import random
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from dodo_dsl.opendlv import message_versions
from dodo_dsl.opendlv.envelope import Envelope, encode_frame
from dodo_dsl.opendlv.message_set import MessageSet
from dodo_dsl.opendlv.odvd import INTEGER_BITS, STANDARD, STANDARD_0_9, Field, integer_range, load

pytestmark = pytest.mark.slow

TOOLS = Path(sys.executable).parent
FILES = {STANDARD: MessageSet.standard(), STANDARD_0_9: message_versions.load(message_versions.OLD)}
each_file = pytest.mark.parametrize("file", FILES, ids=lambda file: file.name)


def some_value(field: Field, rng: random.Random) -> Any:
    if field.type == "string":
        return rng.choice(["", "yellow", "h264 äö"])
    if field.type == "bytes":
        return rng.randbytes(rng.randrange(9))
    if field.type == "bool":
        return rng.random() < 0.5
    if field.type in ("float", "double"):
        return rng.randrange(-80_000, 80_000) / 8
    values = integer_range(field.type)
    return rng.randint(values[0], values[-1])


def least(field: Field) -> Any:
    if field.type in INTEGER_BITS:
        return integer_range(field.type)[0]
    return {"string": "", "bytes": b"", "bool": False}.get(field.type, -(2.0**127))


def most(field: Field) -> Any:
    if field.type in INTEGER_BITS:
        return integer_range(field.type)[-1]
    return {"string": "ÿ" * 200, "bytes": bytes(range(256)), "bool": True}.get(field.type, 2.0**127)


def same(written: str, value: Any) -> bool:
    if isinstance(value, float):
        return float(written) == pytest.approx(value, rel=1e-5)
    if isinstance(value, int):
        return int(written) == value
    return base64.b64decode(written) == (value if isinstance(value, bytes) else value.encode())


@each_file
def test_every_message_is_read_by_libcluon(file: Path, tmp_path: Path) -> None:
    pytest.importorskip("pycluon")
    rng, messages, definitions = random.Random(2900), FILES[file], load(file)
    kinds: list[Callable[[Field], Any]] = [least, most, lambda field: some_value(field, rng)]
    expected = {
        (d, stamp): {f.name: kind(f) for f in d.fields} for d in definitions for stamp, kind in enumerate(kinds)
    }
    with (tmp_path / "all.rec").open("wb") as recording:
        for (definition, stamp), values in expected.items():
            payload = messages.encode(messages.type(definition.id)(**values))
            recording.write(encode_frame(Envelope(definition.id, payload, 1_000_002, 0, -5, stamp)))
    command = [TOOLS / "cluon-rec2csv", "--rec=all.rec", f"--odvd={file}"]
    subprocess.run(command, cwd=tmp_path, check=True, capture_output=True, timeout=60)
    for (definition, stamp), values in expected.items():
        with (tmp_path / f"{definition.name}-{stamp}.csv").open() as table:
            (row,) = csv.DictReader(table, delimiter=";")
        assert (row["sent.seconds"], row["sent.microseconds"], row["sampleTimeStamp.microseconds"]) == ("1", "2", "-5")
        wrong = {key: value for key, value in values.items() if not same(row[key], value)}
        assert wrong == {}, (definition.name, row)


@each_file
def test_libcluon_s_compiler_finds_the_same_fields(file: Path, tmp_path: Path) -> None:
    pytest.importorskip("pycluon")
    command = [TOOLS / "cluon-msc", "--proto", f"--out={tmp_path / 'all.proto'}", file]
    subprocess.run(command, check=True, capture_output=True, timeout=60)
    found = re.findall(
        r"identifier: (\d+)\.\nmessage (\w+) \{\n(.*?)\}", (tmp_path / "all.proto").read_text(), re.DOTALL
    )
    assert {(int(id_), name, *re.findall(r"(\w+ \w+ = \d+)", fields)) for id_, name, fields in found} == {
        (d.id, d.name.replace(".", "_"), *map(as_proto, d.fields)) for d in load(file)
    }


def as_proto(field: Field) -> str:
    bits = INTEGER_BITS.get(field.type)
    kind = field.type if bits is None else f"{'sint' if field.type.startswith('int') else 'uint'}{max(bits, 32)}"
    return f"{kind} {field.name} = {field.number}"
