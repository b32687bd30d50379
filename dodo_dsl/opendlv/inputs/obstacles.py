"""The obstacles of an OpenDLV map as an evaluator needs them: each with a name and lines on the ground."""

from pathlib import Path

from dodo_dsl.opendlv.inputs.json_node import MapError, Node

Line = tuple[tuple[float, float], tuple[float, float]]
NUMBERS = 4
FARTHEST = 1e300
MAX_LINES = 10_000
"""Of all obstacles of a map, to each of which evaluators measure the distance."""


def read(path: Path) -> dict[str, list[Line]]:
    """The lines of each obstacle of the map in a folder (its `map.json`) or of the map file itself, in metres.

    Obstacles of one name are one. Raises MapError.
    """
    file = path if path.suffix == ".json" else path / "map.json"
    root = Node.load(file)
    require_few_lines(root)
    found: dict[str, list[Line]] = {}
    for entry in root.items("obstacles"):
        name, lines = _obstacle(entry)
        found.setdefault(name, []).extend(lines)
    return found


def require_few_lines(root: Node) -> None:
    """Raises MapError for more lines than a map may have."""
    lines = [o.value.get("lines") for o in root.items("obstacles") if isinstance(o.value, dict)]
    if (count := sum(len(each) for each in lines if isinstance(each, list))) > MAX_LINES:
        what = f"{count} lines of obstacles, expected at most {MAX_LINES}"
        raise MapError(root.file, what, "$.obstacles", hint="write long lines in the place of many short ones")


def _obstacle(entry: Node) -> tuple[str, list[Line]]:
    value = entry.value
    if not isinstance(value, dict) or not isinstance(value.get("name"), str) or not value["name"].strip():
        raise MapError(entry.file, "expected an object with a name", entry.place)
    if value["name"] != value["name"].strip():
        what = f"the name '{value['name']}' has blanks around it, with which a test does not find it"
        raise MapError(entry.file, what, f"{entry.place}.name", hint=f'write "{value["name"].strip()}"')
    lines, place = value.get("lines"), f"{entry.place}.lines"
    if not isinstance(lines, list) or not lines:
        raise MapError(entry.file, "expected a list of lines [x1, y1, x2, y2]", place)
    if not isinstance(lines[0], list):
        return value["name"], [_line(Node(entry.file, place, lines))]
    return value["name"], [_line(Node(entry.file, f"{place}[{index}]", line)) for index, line in enumerate(lines)]


def _line(node: Node) -> Line:
    numbers = node.value if isinstance(node.value, list) else []
    if len(numbers) != NUMBERS or not all(_is_number(value) for value in numbers):
        raise MapError(node.file, "expected four numbers [x1, y1, x2, y2] in metres", node.place)
    x1, y1, x2, y2 = (float(value) for value in numbers)
    return (x1, y1), (x2, y2)


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < FARTHEST
