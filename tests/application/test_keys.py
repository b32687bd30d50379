"""What becomes of each key of the compose specification in a test, by the table in ``keys.yml``."""

import functools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import check_jsonschema
import orjson
import pytest
import yaml

from tests.application.compiled import FILE, WAYS, Compiled, compiled, repository, uniform

TABLE: dict[str, dict[str, list[Any]]] = yaml.safe_load((Path(__file__).parent / "keys.yml").read_text())
VENDORED = Path(check_jsonschema.__file__).parent / "builtin_schemas" / "vendor" / "compose-spec.json"
FILES = {
    "a.env": "A=1\n",
    "cid.env": "OD4SESSION_CID=111\n",
    "Dockerfile": "FROM scratch\n",
    "Dockerfile.car": "FROM scratch\n",
    "data/x": "x",
    "written/x": "x",
    "other.yml": "services: {}\n",
    "../other/Dockerfile": "FROM scratch\n",
}
SHARED = {"volume": "volumes", "secret": "secrets", "config": "configs", "network": "networks"}
ERRORS = {"application-key", "application-isolation", "application-hardware"}


@dataclass(frozen=True)
class Row:
    """What is ``written`` at a level of a compose file, and what becomes of it in each kind of test.

    That is either a word, a group of the table, or what the compiled test has, where None stands for nothing.
    """

    level: str
    group: str
    written: dict[str, Any]
    rule: str
    expected: Mapping[str, Any]

    @property
    def name(self) -> str:
        return f"{self.level} {self.written}"

    @property
    def has_ways(self) -> bool:
        return len({*map(str, self.expected.values())}) > 1

    @property
    def document(self) -> dict[str, Any]:
        """A compose file with a service that has it."""
        service: dict[str, Any] = {"image": "team/a", "command": "--cid=111"}
        found: dict[str, Any] = {
            "services": {"s": service, "b": {"image": "team/b", "container_name": "eyes"}},
            "volumes": {"named": {}, "tmp": {}, "report": {}, "shared": {"external": True}},
            "secrets": {"s": {"file": "./a.env"}},
            "configs": {"c": {"file": "./a.env"}},
            "networks": {"n": {}},
        }
        if self.level == "service":
            service |= self.written
        elif self.level == "build":
            service["build"] = {"context": ".", **self.written}
        elif self.level == "mount":
            mount = {"type": "bind", "source": "./data", "target": "/d", "read_only": True}
            service["volumes"] = [{**mount, **self.written}]
        elif self.level in SHARED:
            own = self.written.keys() & {"file", "content", "environment", "external"}
            has_own = own or self.level in ("volume", "network")
            found[SHARED[self.level]]["own"] = {**({} if has_own else {"file": "./a.env"}), **self.written}
            service[SHARED[self.level]] = ["own:/v:ro" if self.level == "volume" else "own"]
        else:
            for key, value in self.written.items():
                found[key] = {**(found.get(key) or {}), **value} if isinstance(value, dict) else value
        return found

    def found(self, test: Compiled) -> Any:
        """What the compiled test has in its place."""
        service = test.services["s"]
        if self.level in ("service", "build"):
            return service if self.level == "service" else service.get("build")
        if self.level == "mount":
            return service["volumes"][0] if service.get("volumes") else None
        if self.level == "file":
            return test.document
        return uniform(test.document.get(SHARED[self.level], {}).get("own") or {}, test.folder)


def rows() -> Iterator[Row]:
    for level, groups in TABLE.items():
        for group, entries in groups.items():
            for entry in entries:
                written, *rest = entry if isinstance(entry, list) else [entry]
                expected = rest[0] if rest else group
                others = rest[1] if len(rest) > 1 else {}
                keys = {key: value for key, value in written.items() if key != "rule"}
                yield Row(level, group, keys, written.get("rule", ""), {**dict.fromkeys(WAYS, expected), **others})


ROWS = list(rows())
ALONE = ("refused", "left out or refused")
"""What ends a compilation, or may."""


@pytest.fixture
def root(tmp_path: Path) -> Path:
    return repository(tmp_path, FILES)


def problem(row: Row, way: str, test: Compiled, root: Path) -> str:
    """How what became of a row differs from the table; empty if it does not."""
    expected = row.expected[way]
    named = [told for told in test.told if told.rule in ("application-key", "application-hardware")]
    named = [told for told in named if "of 'b'" not in told.text]
    if test.errors:
        may_be = expected in ALONE or (row.group == "changed or refused" and way != "hil")
        rules = {row.rule} if row.rule else ERRORS
        is_fine = may_be and {(told.rule in rules, told.file) for told in test.errors} == {(True, FILE)}
        return "" if is_fine else f"refused: {test.errors}"
    if expected == "refused":
        return "not refused"
    made = row.found(test)
    if expected in ("left out", *ALONE):
        left = [key for key in row.written if made and key in made and key not in ("services", "networks")]
        left += [str(made)] if row.level == "service" and set(row.written) & {"volumes"} and made.get("volumes") else []
        many = [told for told in named if told.rule == "application-key"]
        return f"has {left}, and {many}" if left or len(many) > 1 else ""
    if expected == "carried or left out":
        return "" if all(made.get(key, value) == value for key, value in own_form(row, root).items()) else f"has {made}"
    if row.level == "file":
        return "" if all(set(names) <= set(made[key]) for key, names in row.written.items()) else f"has {made}"
    wanted = own_form(row, root) if expected == "carried" else expected
    if expected == "carried" and named:
        return f"with a warning: {named}"
    if not isinstance(wanted, dict):
        return "" if made == wanted else f"has {made}"
    differ = {
        key: (made or {}).get(key) for key, value in wanted.items() if not same(key, (made or {}).get(key), value)
    }
    return f"has {differ}" if differ else ""


def own_form(row: Row, root: Path) -> dict[str, Any]:
    found = uniform(row.written, root)
    if row.level == "build" and "additional_contexts" in found:
        found = uniform({"build": {"context": ".", **row.written}}, root)["build"]
    if row.level == "build" and "context" in found:
        found["context"] = uniform({"build": row.written}, root)["build"]["context"]
    return found


def same(key: str, made: Any, wanted: Any) -> bool:
    """Whether they are; a test adds variables and dependencies of its own."""
    if key in ("environment", "depends_on", "volumes", "configs", "secrets") and isinstance(wanted, dict):
        return isinstance(made, dict) and {name: made.get(name) for name in wanted} == wanted
    return made == wanted


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize(("level", "group"), [(level, group) for level, groups in TABLE.items() for group in groups])
def test_what_becomes_of_each_key(level: str, group: str, way: str, root: Path) -> None:
    taken = [row for row in ROWS if (row.level, row.group) == (level, group) and (way != "host" or row.has_ways)]
    made = {
        row.name: problem(row, way, compiled(root, row.document, way, environment=["PASSED"]), root) for row in taken
    }
    assert {name: said for name, said in made.items() if said} == {}


@functools.cache
def schema() -> dict[str, Any]:
    """Compose's schema."""
    read: dict[str, Any] = orjson.loads(VENDORED.read_bytes())
    return read


def keys(name: str) -> set[str]:
    """The keys of a definition of the schema."""
    return set(schema()["$defs"][name]["properties"])


def long_form(definition: str, key: str) -> set[str]:
    """The keys of the long form of a key's value, or of an item of it."""
    about = schema()["$defs"][definition]["properties"][key]
    (form,) = (form for form in about.get("oneOf") or about["items"]["oneOf"] if "properties" in form)
    return set(form["properties"])


@pytest.mark.parametrize(
    ("level", "expected", "elsewhere"),
    [
        ("file", set(schema()["properties"]), {"services"}),
        ("service", keys("service") | keys("container_spec") | keys("workload_spec"), {"extends"}),
        ("build", long_form("workload_spec", "build"), set()),
        ("mount", long_form("container_spec", "volumes"), {"target", "read_only"}),
        *((level, keys(level), set()) for level in SHARED),
    ],
    ids=["file", "service", "build", "mount", *SHARED],
)
def test_each_key_of_the_specification_has_a_row(level: str, expected: set[str], elsewhere: set[str]) -> None:
    """``extends`` is merged before: see merging.yml."""
    have = {key for row in ROWS if row.level == level for key in row.written} | elsewhere
    assert {key for key in expected - have if not key.startswith("x-")} == set()
