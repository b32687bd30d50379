"""The camera's holder: its two plates from above, with their holes."""

from itertools import pairwise
from typing import Any

from firmware.drawings import parts
from firmware.drawings.measures import PLATE
from firmware.drawings.sheet import Sheet, mm

_ASIDE = 105.0
"""Where the camera's plate is drawn."""


def drawing() -> str:
    sheet = Sheet(900, 440, 3.2, (430, 200))
    sheet.text((0, 0), f"The camera's holder, two plates of {mm(PLATE)}; measures in mm", (-410, -176))
    _outline(sheet, parts.hub_outline(), 0.0, 0.0)
    _outline(sheet, parts.camera_outline(), _ASIDE, -20.0)
    sheet.text((parts.HUB_BACK, parts.HUB_HALF), "hub plate, from above; forward is right", (0, -8))
    sheet.text((_ASIDE, 24), "camera plate, from its back", (0, -6), "middle")
    _hub_measures(sheet)
    _camera_measures(sheet)
    return sheet.svg()


def _outline(sheet: Sheet, outline: Any, right: float, up: float) -> None:
    """The edges of the plate that is printed."""
    for ring in (outline.exterior, *outline.interiors):
        sheet.path([(x + right, y + up) for x, y in ring.coords[:-1]], closed=True)


def _hub_measures(sheet: Sheet) -> None:
    low = -parts.HUB_HALF
    first = parts.PI_BACK + parts.PI_EDGE
    places = [parts.HUB_BACK, first, first + parts.PI_HOLES[0], 0.0, parts.HUB_FRONT]
    for begin, end in pairwise(places):
        sheet.across(begin, end, low - 12, mm(end - begin), (low, low))
    sheet.across(parts.HUB_BACK, parts.HUB_FRONT, low - 24, mm(parts.HUB_FRONT - parts.HUB_BACK), (low, low))
    sheet.up(-parts.PI_HOLES[1] / 2, parts.PI_HOLES[1] / 2, -80, mm(parts.PI_HOLES[1]), (first, first))
    sheet.up(low, -low, parts.HUB_BACK - 8, mm(2 * parts.HUB_HALF), (parts.HUB_BACK, parts.HUB_BACK))
    sheet.up(-parts.TAB_AT, parts.TAB_AT, parts.HUB_FRONT + 10, mm(2 * parts.TAB_AT), (-3, -3))
    sheet.text((-72, 6), f"4 x {mm(parts.PI_HOLE)}: Raspberry Pi")
    sheet.text((-72, -6), f"4 x {mm(parts.FLANGE_HOLE)} on {mm(parts.FLANGE)}: coupling")


def _camera_measures(sheet: Sheet) -> None:
    base, left, right = -20.0, _ASIDE - parts.CAMERA_HALF, _ASIDE + parts.CAMERA_HALF
    lens, top = base + parts.LENS_MARGIN, base + parts.LENS_MARGIN + parts.LENS_DROP
    holes = parts.CAMERA_HOLES
    sheet.across(_ASIDE - holes[0] / 2, _ASIDE + holes[0] / 2, base - 8, mm(holes[0]), (lens, lens))
    sheet.across(left, right, base - 18, mm(2 * parts.CAMERA_HALF), (base, base))
    sheet.up(base, lens, left - 8, mm(parts.LENS_MARGIN), (left, _ASIDE))
    sheet.up(lens, top, left - 8, mm(parts.LENS_DROP), (_ASIDE, left))
    sheet.up(lens, lens + holes[1], right + 8, mm(holes[1]), (_ASIDE, _ASIDE + holes[0] / 2))
    words = f"window {mm(parts.WINDOW)} x {mm(parts.WINDOW)}; 4 x {mm(parts.CAMERA_HOLE)}"
    sheet.text((_ASIDE, base - 18), words, (0, 20), "middle")
