"""Whatever a compose file says: it is judged, nothing breaks, and what is compiled of it is harmless."""

import functools
from pathlib import Path
from typing import Any

import pytest
import yaml
from hypothesis import HealthCheck, event, given, settings
from hypothesis import strategies as st

from tests.application.compiled import compiled, repository
from tests.application.test_keys import schema
from tests.hostile.harmless import harm

Values = st.SearchStrategy[Any]

_TEXTS = """
host | none | x | b | 1 | 1s | 64m | 64g | -1 | true | service:b | container:x | bridge | / | .. | . | ./data |
../other | link | /etc | ~ | ~nobody/x | /dev | /dev/sda | /tmp | /usr/share | ./data:/d | ./data:/d:ro | /:/h |
vol:/v | link:/l | /tmp:/tmp | /var/run/docker.sock:/s | : | a:b:c | ${A | ${A:-/} | ${A:-host} | ${A:-./data} | $$A |
A=1 | A | CI_JOB_TOKEN | x=y | h=/etc | ALL | SYS_ADMIN | SYS_NICE | seccomp:unconfined | no-new-privileges:true |
bind | bind,ro | size=64g | volume | tmpfs | local | nfs | vol | n | syslog | json-file | size=64m | /t:size=64g |
/t | rshared | a.env | /etc/passwd | Dockerfile | file:///x | https://a.b/c.git | oci-layout:///var/lib | b:ro | cdi |
service_healthy | service_started | --cid=111 | writable | default | nvidia | runc | c 1:3 mr | b 8:* r
"""
WORDS = st.sampled_from(["", *(text.strip() for text in _TEXTS.split("|"))])
NAMES = st.sampled_from(
    ["a", "b", "vol", "n", "A", "nofile", "core", "memlock", "o", "type", "device", "x-a", "max-size"]
)
ANY = st.recursive(
    st.none() | st.booleans() | st.integers(-2, 1 << 40) | st.floats(allow_nan=False, allow_infinity=False) | WORDS,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(NAMES | WORDS, inner, max_size=3),
    max_leaves=6,
)


def of(node: Any) -> Values:
    """Values that a node of compose's schema describes, at times others."""
    return of_name(node["$ref"].rpartition("/")[2]) if "$ref" in node else _of(node)


@functools.cache
def of_name(name: str) -> Values:
    return st.deferred(lambda: _of(schema()["$defs"][name]))


def _of(node: Any) -> Values:
    if "enum" in node:
        return st.sampled_from(node["enum"])
    if branches := node.get("oneOf") or node.get("anyOf"):
        return st.one_of(*map(of, branches))
    types = node.get("type", "object")
    kinds = {
        "null": st.none(),
        "boolean": st.booleans(),
        "integer": st.sampled_from([-1, 0, 1, 1024, 1 << 40]),
        "number": st.sampled_from([-1, 0, 0.5, 64, 1 << 40]),
        "string": WORDS,
    }
    found = [kinds[kind] for kind in ([types] if isinstance(types, str) else types) if kind in kinds]
    if "array" in types:
        found.append(st.lists(of(node.get("items", {})), max_size=2))
    if "object" in types:
        found.append(_mapping(node))
    return st.one_of(*found)


def _mapping(node: Any) -> Values:
    keys = {key: of(inner) for key, inner in node.get("properties", {}).items()}
    patterns = [inner for pattern, inner in node.get("patternProperties", {}).items() if pattern != "^x-"]
    needed = {key: keys[key] for key in node.get("required", ())}
    more = st.dictionaries(NAMES, of(patterns[0]), max_size=2) if patterns else st.just({})
    if not keys:
        return more
    few = st.lists(st.sampled_from(sorted(keys)), max_size=3, unique=True)
    chosen = few.flatmap(lambda names: st.fixed_dictionaries({**needed, **{name: keys[name] for name in names}}))
    return st.builds(lambda one, other: {**other, **one}, chosen, more)


SERVICE = st.builds(
    lambda own: {"image": "x", "command": "--cid=111", **own},
    of_name("service") | of_name("workload_spec") | of_name("container_spec"),
)
FILES = st.fixed_dictionaries(
    {"services": st.fixed_dictionaries({"a": SERVICE, "b": st.just({"image": "x"})})},
    optional={
        key: st.fixed_dictionaries({name: st.just({}) | of_name(key[:-1]) for name in names})
        for key, names in (("volumes", ["vol"]), ("secrets", ["x"]), ("configs", ["x"]), ("networks", ["n"]))
    },
)


@pytest.mark.slow
@settings(suppress_health_check=[*HealthCheck], deadline=None, max_examples=100)
@given(
    document=FILES,
    odd=st.none() | st.tuples(st.sampled_from(["privileged", "volumes", "build", "command", "ulimits", "x"]), ANY),
)
def test_it_is_judged(document: dict[str, Any], odd: tuple[str, Any] | None, tmp_path: Path) -> None:
    """A file of any of compose's keys and values is refused, or harmless."""
    if odd:
        document["services"]["a"][odd[0]] = odd[1]
    root = tmp_path / "team"
    if not root.exists():
        repository(tmp_path, {"a.env": "A=1\n", "data/x": "x", "Dockerfile": "FROM x\n", "../other/x": "x"})
        (root / "link").symlink_to("/etc")
    test = compiled(root, document)
    event("refused" if test.errors else "compiled")
    if not test.errors:
        assert list(harm(test.document, root)) == []
        yaml.safe_load(test.files["application.compose.yml"])
