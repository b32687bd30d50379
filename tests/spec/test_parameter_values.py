"""Values of parameters as their flags carry them."""

import os
from pathlib import Path

import pytest

from dodo_dsl.spec.arguments import Value, ValueProblem, convert, default_value
from dodo_dsl.spec.manifest import Parameter
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
REFUSED = [
    (RATE, "50", "wrong-unit"),
    (RATE, "101 Hz", "out-of-range"),
    (RATE, "", "wrong-type"),
    (parameter("number", minimum=2), "1", "out-of-range"),
    (parameter("number", unit="1", maximum=1), "2", "out-of-range"),
    (parameter("number"), "1 m", "wrong-unit"),
    (parameter("number"), ".inf", "wrong-type"),
    (parameter("integer"), "1.5", "wrong-type"),
    (parameter("integer"), "true", "wrong-type"),
    (parameter("amount"), "25 %", "wrong-unit"),
    (parameter("amount"), "1 parsec", "wrong-unit"),
    (parameter("amount", minimum=0), "-1 m", "out-of-range"),
    (parameter("string"), "[a]", "wrong-type"),
    (parameter("string", choices=("a", "b")), "c", "wrong-value"),
    (parameter("boolean"), "yes", "wrong-type"),
    (parameter("memory"), "a/b", "wrong-value"),
    (parameter("message"), "a.", "wrong-value"),
    *((parameter("output"), name, "path-escape") for name in ("a/b", "../a.rec", "/etc/cron.d/a", ".bashrc", "''")),
    (parameter("list", of="integer"), "[0, 1.5]", "wrong-type"),
    (parameter("list", of="number", unit="m"), "[1 m, 2]", "wrong-unit"),
    (parameter("list", of="number", unit="m", maximum=1), "[1 m, 2 m]", "out-of-range"),
    (parameter("list"), "['a,b']", "wrong-value"),
    (parameter("list"), "{a: b}", "wrong-type"),
    (parameter("path"), "/etc", "path-escape"),
]


@pytest.mark.parametrize(("parameter", "written", "expected"), CASES)
def test_values(parameter: Parameter, written: str, expected: Value) -> None:
    assert convert(parameter, value(written), ROOT) == expected


@pytest.mark.parametrize(("parameter", "written", "rule"), REFUSED)
def test_values_that_do_not_fit(parameter: Parameter, written: str, rule: str) -> None:
    with pytest.raises(ValueProblem) as problem:
        convert(parameter, value(written), ROOT)
    assert problem.value.diagnostic.rule == rule


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
    ("text", "rule", "hint"),
    [
        ("../map", "missing-file", "did you mean '../maps'?"),
        ("maps", "missing-file", "did you mean '../maps'?"),
        ("../..", "path-escape", ""),
        ("../up", "path-escape", ""),
        ("../pipe", "unreadable-file", ""),
        ("a" * 300, "missing-file", ""),
        ("../loop", "missing-file", ""),
    ],
)
def test_paths_that_are_refused(text: str, rule: str, hint: str, registry: Path) -> None:
    (registry / "loop").symlink_to("loop")
    with pytest.raises(ValueProblem) as problem:
        path(registry, text)
    assert problem.value.diagnostic.rule == rule
    assert hint in problem.value.diagnostic.hint
