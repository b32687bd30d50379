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

from tests.application.compiled import FILE, WAYS, Compiled, Told, compiled, repository, uniform

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
WARNS = ("application-key", "application-hardware")
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
    number: int

    def may_be_refused(self, way: str) -> bool:
        return self.expected[way] in ALONE or (self.group == "changed or refused" and way != "hil")

    @property
    def name(self) -> str:
        return f"{self.level} {self.written}"

    @property
    def service(self) -> str:
        return f"s{self.number}"

    @property
    def entry(self) -> str:
        return f"{self.level}{self.number}"

    def add(self, document: dict[str, Any]) -> None:
        """Adds a service with it to a compose file."""
        service: dict[str, Any] = {"image": "team/a", "command": "--cid=111"}
        if self.level == "service":
            service |= self.written
        elif self.level == "build":
            service["build"] = {"context": ".", **self.written}
        elif self.level == "mount":
            mount = {"type": "bind", "source": "./data", "target": "/d", "read_only": True}
            service["volumes"] = [{**mount, **self.written}]
        elif self.level in SHARED:
            own = set(self.written) & {"file", "content", "environment", "external"} or self.level in (
                "volume",
                "network",
            )
            document[SHARED[self.level]][self.entry] = {**({} if own else {"file": "./a.env"}), **self.written}
            service[SHARED[self.level]] = [f"{self.entry}:/v:ro" if self.level == "volume" else self.entry]
        else:
            for key, value in self.written.items():
                document[key] = {**(document.get(key) or {}), **value} if isinstance(value, dict) else value
        document["services"][self.service] = service

    def found(self, test: Compiled) -> Any:
        """What the compiled test has in its place."""
        if self.level in ("service", "build", "mount"):
            service = test.services[self.service]
            found = service if self.level == "service" else service.get("build" if self.level == "build" else "volumes")
            return found[0] if self.level == "mount" and found else found
        if self.level == "file":
            return test.document
        return uniform(test.document.get(SHARED[self.level], {}).get(self.entry) or {}, test.folder)


def rows() -> Iterator[Row]:
    number = 0
    for level, groups in TABLE.items():
        for group, entries in groups.items():
            for entry in entries:
                number += 1
                written, *rest = entry if isinstance(entry, list) else [entry]
                expected = rest[0] if rest else group
                others = rest[1] if len(rest) > 1 else {}
                keys = {key: value for key, value in written.items() if key != "rule"}
                yield Row(
                    level, group, keys, written.get("rule", ""), {**dict.fromkeys(WAYS, expected), **others}, number
                )


ROWS = list(rows())
ALONE = ("refused", "left out or refused")
"""What ends a compilation, or may."""


@pytest.fixture
def root(tmp_path: Path) -> Path:
    return repository(tmp_path, FILES)


def document(*written: Row) -> dict[str, Any]:
    found: dict[str, Any] = {
        "services": {"b": {"image": "team/b", "container_name": "eyes"}},
        "volumes": {"named": {}, "tmp": {}, "report": {}, "shared": {"external": True}},
        "secrets": {"s": {"file": "./a.env"}},
        "configs": {"c": {"file": "./a.env"}},
        "networks": {"n": {}},
    }
    for row in written:
        row.add(found)
    return found


def lines(row: Row, root: Path) -> range:
    """Where the row stands in the compose file."""
    text = (root / FILE).read_text().splitlines()
    if row.level in ("service", "build", "mount"):
        first = text.index(f'  "{row.service}":') + 1
        after = (n for n, line in enumerate(text[first:], first + 1) if not line.startswith("    "))
        return range(first, next(after, len(text) + 1))
    keys = [f'  "{row.entry}":'] if row.level in SHARED else [f'"{key}":' for key in row.written]
    first = next((n for n, line in enumerate(text, 1) if any(line.startswith(key) for key in keys)), 1)
    after = (
        n
        for n, line in enumerate(text[first:], first + 1)
        if not line.startswith(" " * (len(keys[0]) - len(keys[0].lstrip()) + 1))
    )
    return range(first, next(after, len(text) + 1))


def problem(row: Row, way: str, test: Compiled, root: Path) -> str:
    """How what became of a row differs from the table; empty if it does not."""
    expected, place = row.expected[way], lines(row, root)
    own = [told for told in test.told if told.file == FILE and told.line in place]
    named = [told for told in own if told.rule in WARNS and told.severity == "warning"]
    if test.errors:
        return refused(row, own, test) if row.may_be_refused(way) else f"refused: {test.errors}"
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


def refused(row: Row, own: list[Told], test: Compiled) -> str:
    errors = [told for told in own if told.severity == "error"]
    rules = {row.rule} if row.rule else ERRORS
    return "" if errors and {told.rule for told in test.errors} <= rules else f"refused elsewhere: {test.errors}"


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("level", [level for level in TABLE if level != "file"])
def test_what_becomes_of_each_key(level: str, way: str, root: Path) -> None:
    taken = [row for row in ROWS if row.level == level and not row.may_be_refused(way)]
    test = compiled(root, document(*taken), way, environment=["PASSED"])
    assert test.errors == []
    assert {row.name: said for row in taken if (said := problem(row, way, test, root))} == {}


def alone() -> Iterator[tuple[Row, str]]:
    """The rows that need a compilation of their own: one of the three where all are refused."""
    for row in ROWS:
        same_for_all = all(row.expected[way] == "refused" for way in WAYS)
        for way in WAYS[:1] if same_for_all or row.level == "file" else WAYS:
            if row.level == "file" or row.may_be_refused(way):
                yield row, way


@pytest.mark.parametrize(("row", "way"), [pytest.param(*case, id=f"{case[0].name} {case[1]}") for case in alone()])
def test_what_is_refused(row: Row, way: str, root: Path) -> None:
    test = compiled(root, document(row), way)
    assert problem(row, way, test, root) == ""


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
