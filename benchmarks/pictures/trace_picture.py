"""Draws traces of ``run_trace`` below one another, at one scale, as an SVG.

python -m benchmarks.pictures.trace_picture OUT.svg TITLE=TRACE.json [TITLE=TRACE.json ...]
"""

import json
import sys
from collections.abc import Sequence
from html import escape
from pathlib import Path
from typing import Any

from dodo_dsl import atomic

WIDTH, LEFT, RIGHT, LANE, GAP = 960, 160, 20, 26, 34
"""Pixels: of the image, beside the bars, of a lane, and above each trace."""
LETTER = 6.2
COLOURS = (
    "#4878cf", "#6acc65", "#d65f5f", "#b47cc7", "#c4ad66", "#77bedb",
    "#8c8c8c", "#e08030", "#5a9e8f", "#3d7a5c", "#a05a2c",
)  # fmt: skip


def spans(trace: dict[str, Any]) -> tuple[list[str], list[dict[str, Any]]]:
    """The names of a trace's lanes, and its phases."""
    events = trace["traceEvents"]
    names = {event["tid"]: event["args"]["name"] for event in events if event["ph"] == "M"}
    return [names[number] for number in sorted(names)], [event for event in events if event["ph"] == "X"]


def draw(traces: dict[str, dict[str, Any]]) -> str:
    """The image; ``traces`` by their titles."""
    found = {title: spans(trace) for title, trace in traces.items()}
    longest = max(phase["ts"] + phase["dur"] for _, phases in found.values() for phase in phases) / 1e6
    scale, top, rows = (WIDTH - LEFT - RIGHT) / longest, 0, list[str]()
    kinds = list(dict.fromkeys(phase["name"] for _, phases in found.values() for phase in phases))
    for title, (lanes, phases) in found.items():
        end = max(phase["ts"] + phase["dur"] for phase in phases) / 1e6
        rows.append(f'<text x="8" y="{top + 22}" font-weight="bold">{escape(title)}: {end:.2f} s</text>')
        top += GAP
        for number, lane in enumerate(lanes):
            y = top + number * LANE
            rows.append(f'<text x="8" y="{y + 16}">{escape(lane)}</text>')
            rows += [bar(phase, y, scale, COLOURS[kinds.index(phase["name"]) % len(COLOURS)])
                     for phase in phases if phase["tid"] == number]  # fmt: skip
        top += len(lanes) * LANE
    ticks = [
        f'<path d="M{LEFT + second * scale:.1f} {GAP}V{top}" stroke="#999" stroke-dasharray="2 3"/>'
        f'<text x="{LEFT + second * scale:.1f}" y="{top + 16}" text-anchor="middle">{second} s</text>'
        for second in range(int(longest) + 1)
    ]
    size = f'width="{WIDTH}" height="{top + 24}" viewBox="0 0 {WIDTH} {top + 24}"'
    head = f'<svg xmlns="http://www.w3.org/2000/svg" {size} font-family="sans-serif" font-size="12">'
    return "\n".join([head, '<rect width="100%" height="100%" fill="white"/>', *ticks, *rows, "</svg>", ""])


def bar(phase: dict[str, Any], y: int, scale: float, colour: str) -> str:
    """One phase, with its name if there is room, and its time as a tooltip."""
    x, width, seconds = LEFT + phase["ts"] / 1e6 * scale, phase["dur"] / 1e6 * scale, phase["dur"] / 1e6
    name = escape(phase["name"])
    text = f'<text x="{x + 4:.1f}" y="{y + 16}" fill="white">{name}</text>' if width > LETTER * len(name) + 8 else ""
    box = f'<rect x="{x:.1f}" y="{y + 2}" width="{max(width, 1):.1f}" height="{LANE - 6}" fill="{colour}">'
    return f"{box}<title>{name}: {seconds:.2f} s</title></rect>{text}"


def main(words: Sequence[str]) -> int:
    if len(words) < 2 or not all("=" in word for word in words[1:]):
        print(__doc__, file=sys.stderr)
        return 2
    pairs = [word.split("=", 1) for word in words[1:]]
    atomic.write_text(Path(words[0]), draw({title: json.loads(Path(path).read_text()) for title, path in pairs}))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
