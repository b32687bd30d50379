"""Values of parameters as their flags carry them."""

import os
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dodo_dsl.diagnostics import Span
from dodo_dsl.source import Scalar
from dodo_dsl.spec.manifest import Parameter
from dodo_dsl.spec.values import Value, ValueProblem, convert, default_value
from tests.source.nodes import mapping, value

ROOT = Path("/registry")


def parameter(kind: str, **more: object) -> Parameter:
    return Parameter("p", kind, "Help.", **more)  # type: ignore[arg-type]


RATE = parameter("number", unit="Hz", minimum=1, maximum=100)
CASES: list[tuple[Parameter, str, Value]] = [
    (RATE, "0.05 kHz", Value("50")),
    (parameter("number", unit="1"), "50 %", Value("0.5")),
    (parameter("number"), "1.50", Value("1.5")),
    (parameter("integer"), "-3", Value("-3")),
    (parameter("amount"), "0.05", Value("0.05")),
    (parameter("amount"), "180 deg", Value("3.14159265358979")),
    (parameter("amount", or_share=True, minimum=0), "2.5e1 %", Value("25%")),
    (parameter("string"), "1.0", Value("1.0")),
    (parameter("string", choices=("a", "b")), "a", Value("a")),
    (parameter("boolean"), "true", Value("true")),
    (parameter("memory"), "/video0.argb", Value("/video0.argb", "memory")),
    (parameter("message"), "a.b.C", Value("a.b.C")),
    (parameter("list"), "[left, 3]", Value("left,3")),
    (parameter("list"), "left", Value("left")),
    (parameter("list", of="number", unit="deg"), "[0 deg, -90 deg, 3.5 deg]", Value("0,-90,3.5")),
    (parameter("list", of="number", unit="m"), "8 cm", Value("0.08")),
    (parameter("list", of="integer"), "[0, 2]", Value("0,2")),
]
MEMORY = "parameter 'p' is 'a/b', expected a shared memory's name such as video0.argb"
REFUSED = [
    (RATE, "50", "wrong-unit", "parameter 'p': '50' has no unit, expected a frequency in Hz"),
    (RATE, "101 Hz", "out-of-range", "parameter 'p' is 101 Hz, expected 1 to 100 Hz"),
    (RATE, "", "wrong-type", "parameter 'p' is empty, expected a quantity in Hz"),
    (parameter("number", minimum=2), "1", "out-of-range", "parameter 'p' is 1, expected at least 2"),
    (parameter("number", unit="1", maximum=1), "2", "out-of-range", "parameter 'p' is 2, expected at most 1"),
    (parameter("number"), "1 m", "wrong-unit", "parameter 'p' is '1 m', expected a number without a unit"),
    (parameter("number"), ".inf", "wrong-type", "parameter 'p' is '.inf', expected a finite number"),
    (parameter("integer"), "1.5", "wrong-type", "parameter 'p' is '1.5', expected a whole number without a unit"),
    (parameter("integer"), "true", "wrong-type", "parameter 'p' is 'true', expected a whole number without a unit"),
    (parameter("amount"), "25 %", "wrong-unit", "parameter 'p': '25 %' is not a number or a quantity"),
    (parameter("amount"), "1 parsec", "wrong-unit", "parameter 'p': '1 parsec' is not a number or a quantity"),
    (parameter("amount", minimum=0), "-1 m", "out-of-range", "parameter 'p' is -1 m, expected at least 0"),
    (parameter("string"), "[a]", "wrong-type", "parameter 'p' is a list, expected a string"),
    (parameter("string", choices=("a", "b")), "c", "wrong-value", "parameter 'p' is 'c', expected one of a, b"),
    (parameter("boolean"), "yes", "wrong-type", "parameter 'p' is 'yes', expected true or false"),
    (parameter("memory"), "a/b", "wrong-value", MEMORY),
    (parameter("message"), "a.", "wrong-value", "parameter 'p' is 'a.', expected a message's full name"),
    (
        parameter("list", of="integer"),
        "[0, 1.5]",
        "wrong-type",
        "parameter 'p' is '1.5', expected a whole number without a unit",
    ),
    (
        parameter("list", of="number", unit="m"),
        "[1 m, 2]",
        "wrong-unit",
        "parameter 'p': '2' has no unit, expected a length in m",
    ),
    (
        parameter("list", of="number", unit="m", maximum=1),
        "[1 m, 2 m]",
        "out-of-range",
        "parameter 'p' is 2 m, expected at most 1 m",
    ),
    (parameter("list"), "['a,b']", "wrong-value", "parameter 'p': 'a,b' must not contain a comma"),
    (parameter("path"), "/etc", "path-escape", "parameter 'p' is '/etc', expected a path relative to the spec"),
]  # fmt: skip


@pytest.mark.parametrize(("parameter", "written", "expected"), CASES)
def test_values(parameter: Parameter, written: str, expected: Value) -> None:
    assert convert(parameter, value(written), ROOT) == expected


@pytest.mark.parametrize(("parameter", "written", "rule", "message"), REFUSED)
def test_values_that_do_not_fit(parameter: Parameter, written: str, rule: str, message: str) -> None:
    with pytest.raises(ValueProblem) as problem:
        convert(parameter, value(written), ROOT)
    assert (problem.value.diagnostic.rule, problem.value.diagnostic.message) == (rule, message)


@pytest.mark.parametrize(
    ("parameter", "expected"),
    [
        (parameter("string"), None),
        (parameter("boolean", default=False), Value("false")),
        (parameter("list", default=["a", 1]), Value("a,1")),
        (parameter("number", default=0.1), Value("0.1")),
        (parameter("number", default=1e-7), Value("0.0000001")),
        (parameter("memory", default="a"), Value("a", "memory")),
    ],
)
def test_defaults(parameter: Parameter, expected: Value | None) -> None:
    assert default_value(parameter) == expected


@given(st.text(max_size=20))
def test_strings_are_kept_or_refused(text: str) -> None:
    try:
        assert convert(parameter("string"), Scalar(Span("x.yml"), text, text), ROOT).text == text
    except ValueProblem:
        assert not text.isprintable()


@pytest.fixture
def registry(tmp_path: Path) -> Path:
    root = tmp_path / "registry"
    (root / "maps").mkdir(parents=True)
    (root / "t").mkdir()
    (root / "maps/map.json").touch()
    (root / "up").symlink_to(tmp_path)
    os.mkfifo(root / "pipe")
    return root


def path(registry: Path, text: str) -> Value:
    node = mapping(f"key: {text}\n", str(registry / "t/t.dodo.yml"))
    return convert(parameter("path"), node.entries["key"].value, registry)


def test_paths_are_relative_to_the_spec(registry: Path) -> None:
    assert path(registry, "../maps") == Value("../maps", "path", registry / "maps")
    assert path(registry, "../maps/map.json").path == registry / "maps/map.json"


@pytest.mark.parametrize(
    ("text", "rule", "message"),
    [
        ("../map", "missing-file", "there is no file or folder '../map'"),
        ("../..", "path-escape", "'../..' leaves the registry"),
        ("../up", "path-escape", "'../up' leaves the registry"),
        ("../pipe", "unreadable-file", "'../pipe' is a pipe or a device, expected a file or a folder"),
        ("a" * 300, "missing-file", f"'{'a' * 60}' is too long for a path, or a symlink loop"),
        ("../loop", "missing-file", "'../loop' is too long for a path, or a symlink loop"),
    ],
)
def test_paths_that_are_refused(text: str, rule: str, message: str, registry: Path) -> None:
    (registry / "loop").symlink_to("loop")
    with pytest.raises(ValueProblem) as problem:
        path(registry, text)
    found = problem.value.diagnostic
    assert (found.rule, found.message) == (rule, f"parameter 'p': {message}")


@pytest.mark.parametrize(("text", "hint"), [("90", "write '90 %'"), ("150", ""), ("-1", ""), ("120 %", "")])
def test_a_share_beyond_one_may_be_in_percent(text: str, hint: str) -> None:
    with pytest.raises(ValueProblem) as problem:
        convert(parameter("number", unit="1", minimum=0, maximum=1), value(text), ROOT)
    assert problem.value.diagnostic.rule == "out-of-range"
    assert problem.value.diagnostic.hint == hint
