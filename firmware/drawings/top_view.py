"""The rig from above: what the carriages reach, where the switches are, and how long rails have to be."""

from firmware.drawings import parts
from firmware.drawings.measures import (
    CARRIAGE,
    FAR_CLOSES,
    FRAME,
    HOME_CLOSES,
    PROFILE_WIDTH,
    THESIS_RAILS,
    Travel,
    X,
    Y,
)
from firmware.drawings.sheet import Sheet, mm

_GREY, _DASHED, _RED = 'fill="#e8e8e8"', 'stroke-dasharray="6 4"', 'stroke="#c00" stroke-width="2"'


def drawing() -> str:
    sheet = Sheet(880, 740, 0.29, (420, 310))
    sheet.text((0, 0), "The rig from above; measures in mm", (-400, -284))
    _rails(sheet)
    _workspace(sheet)
    _switches(sheet)
    _measures(sheet)
    return sheet.svg()


def _ends(travel: Travel) -> tuple[float, float]:
    """Where the rail begins and ends."""
    return travel.low - FRAME - CARRIAGE / 2, travel.high + FRAME + CARRIAGE / 2


def _swept(travel: Travel) -> tuple[float, float]:
    return travel.low - FRAME - parts.sweep(), travel.high + FRAME + parts.sweep()


def _rails(sheet: Sheet) -> None:
    half, (left, right), (low, high) = PROFILE_WIDTH / 2, _ends(X), _ends(Y)
    for x in (left + half, right - half):
        sheet.box((x - half, low), (x + half, high), _GREY)
        sheet.box((x - 50, -CARRIAGE / 2), (x + 50, CARRIAGE / 2), 'fill="#ccc"')
    sheet.box((left, -half), (right, half), _GREY)
    sheet.box((-CARRIAGE / 2, -50), (CARRIAGE / 2, 50), 'fill="#ccc"')
    sheet.text((left + half, high), "y2", (0, -6), "middle")
    sheet.text((right - half, high), "y1", (0, -6), "middle")
    sheet.text((-CARRIAGE / 2, half), "x: beam", (-60, -6), "end")
    sheet.circle((0, 0), parts.sweep(), _DASHED)
    sheet.path([(0, 0), (parts.sweep(), 0)], 'stroke-width="2" marker-end="url(#end)"')
    sheet.text((parts.sweep(), 0), "forward: x, yaw 0", (6, 16))


def _workspace(sheet: Sheet) -> None:
    sheet.box((X.low, Y.low), (X.high, Y.high), 'stroke="#06c" stroke-width="1.5"')
    sheet.text((X.low, Y.high), f"what the firmware reaches: {mm(X.length)} x {mm(Y.length)}", (60, 18))
    sheet.box((_swept(X)[0], _swept(Y)[0]), (_swept(X)[1], _swept(Y)[1]), _DASHED)
    sheet.text((_swept(X)[0], _swept(Y)[1]), "swept by the hub: legs stand outside", (4, -6))


def _switches(sheet: Sheet) -> None:
    for x, side, word in ((X.low - HOME_CLOSES, -1, "home"), (X.high + FAR_CLOSES, 1, "far")):
        sheet.path([(x, -90), (x, 90)], _RED)
        sheet.text((x, -90), f"x {word}", (6 * -side, 16), "start" if side < 0 else "end")
    for y, shift, word in ((Y.low - HOME_CLOSES, -6, "home"), (Y.high + FAR_CLOSES, 14, "far")):
        for x in (_ends(X)[0] + 20, _ends(X)[1] - 20):
            sheet.path([(x - 50, y), (x + 50, y)], _RED)
        sheet.text((_ends(X)[1], y), f"y1, y2 {word}", (-50, shift), "end")
    sheet.circle((0, 0), 12, 'fill="#000"')
    sheet.text((0, 0), "0, 0", (-30, 44), "end")


def _measures(sheet: Sheet) -> None:
    below = _swept(Y)[0]
    sheet.across(X.low, 0, below - 90, _origin(X), (Y.low, 0))
    sheet.across(0, X.high, below - 90, mm(X.high), (0, Y.low))
    sheet.across(X.low - HOME_CLOSES, X.high + FAR_CLOSES, below - 170, _between(X), (-90, -90))
    sheet.across(*_ends(X), below - 250, f"rail of x: {mm(X.rail())} and more", (0, 0))
    sheet.across(*_swept(X), below - 330, mm(_swept(X)[1] - _swept(X)[0]), (below, below))
    right = _swept(X)[1]
    sheet.up(Y.low, 0, right + 90, _origin(Y), (X.high, 0))
    sheet.up(0, Y.high, right + 90, mm(Y.high), (0, X.high))
    sheet.up(Y.low - HOME_CLOSES, Y.high + FAR_CLOSES, right + 170, _between(Y), (_ends(X)[1], _ends(X)[1]))
    sheet.up(*_ends(Y), right + 250, f"rails of y: {mm(Y.rail())} and more", (_ends(X)[1], _ends(X)[1]))
    sheet.up(*_swept(Y), right + 330, mm(_swept(Y)[1] - _swept(Y)[0]), (right, right))
    notes = (
        f"Red: a switch closes {mm(HOME_CLOSES)} below step 0, the other one {mm(FAR_CLOSES)} above the highest place; "
        f"the frame is {mm(FRAME)} from both places.",
        f"A carriage is taken to be {mm(CARRIAGE)} long. The thesis has rails of {mm(THESIS_RAILS['x'])} and "
        f"{mm(THESIS_RAILS['y'])}: see the bill of materials.",
    )
    for row, note in enumerate(notes):
        sheet.text((0, below - 330), note, (-400, 26 + 18 * row))


def _origin(travel: Travel) -> str:
    """From step 0 to the middle, with where that is from."""
    return f"{mm(-travel.low)} = {travel.offset:g} steps / {travel.steps:g} per m"


def _between(travel: Travel) -> str:
    return f"between the switches' edges: {mm(travel.length + HOME_CLOSES + FAR_CLOSES)}"
