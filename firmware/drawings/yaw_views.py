"""The yaw from above, of a rig of the kind dynamic and of a circle."""

import math

from firmware.drawings.measures import (
    CIRCLE_HOME,
    CIRCLE_STEP,
    INDEX_WIDTH,
    YAW,
    YAW_FAR_CLOSES,
    YAW_FRAME,
    YAW_HOME_CLOSES,
)
from firmware.drawings.sheet import Point, Sheet, mm

_RADIUS = 100.0
_RED = 'stroke="#c00" stroke-width="3"'


def dynamic() -> str:
    sheet = _sheet("The yaw of a rig of the kind dynamic, from above")
    sheet.arc(_RADIUS, YAW.low, YAW.high, 'stroke="#06c" stroke-width="2"')
    home, far = YAW.low - YAW_HOME_CLOSES, YAW.high + YAW_FAR_CLOSES
    for angle in (home, far):
        _ray(sheet, angle, 0.9, 1.1, _RED)
    for angle in (YAW.low - YAW_FRAME, YAW.high + YAW_FRAME):
        _ray(sheet, angle, 0.8, 1.2, 'stroke-width="4"')
    _note(sheet, far, f"far switch closes at {mm(far)}", (-6, -4), "end")
    _note(sheet, home, f"home switch closes at {mm(home)}", (-6, 12), "end")
    sheet.text((0, 0), f"step 0: {mm(YAW.low)} = -{YAW.offset:g} steps / {YAW.steps:g} per degree", (-330, 200))
    sheet.text((0, 0), f"highest: {mm(YAW.high)}; stops of the frame {mm(YAW_FRAME)} beyond both (black)", (-330, 218))
    return sheet.svg()


def circle() -> str:
    sheet = _sheet("The yaw of a rig of the kind circle, from above")
    sheet.circle((0, 0), _RADIUS, 'stroke="#06c" stroke-width="2"')
    sheet.circle((0, 0), 22, 'stroke-dasharray="3 3"')
    sheet.text((0, 0), "slip ring", (0, 46), "middle")
    low = 180.0 - INDEX_WIDTH
    sheet.arc(_RADIUS, low, 180.0, 'stroke="#c00" stroke-width="6"')
    _ray(sheet, low, 0.0, 1.15, 'stroke-width="0.7"')
    _note(sheet, low, f"index closed from {mm(low)} to 180", (-6, 0), "end")
    _note(sheet, CIRCLE_HOME, f"step 0: {mm(CIRCLE_HOME)}, backward", (-6, 10), "end")
    sheet.text((0, 0), f"{mm(CIRCLE_STEP)} degrees a full step; the cable goes through the slip ring", (-330, 200))
    sheet.text((0, 0), "no switch ends the yaw, and nothing is there that it could hit", (-330, 218))
    return sheet.svg()


def _sheet(title: str) -> Sheet:
    sheet = Sheet(600, 430, 1.2, (350, 190))
    sheet.text((0, 0), f"{title}; degrees", (-330, -166))
    sheet.circle((0, 0), 3, 'fill="#000"')
    _ray(sheet, 0.0, 0.0, 1.0, 'stroke-width="2" marker-end="url(#end)"')
    sheet.text((_RADIUS, 0), "0: forward", (12, 4))
    _ray(sheet, 180.0, 0.0, 1.15, 'stroke-width="0.7"')
    sheet.arc(35, 12, 78, 'stroke-width="0.7" marker-end="url(#end)"')
    sheet.text((0, 50), "counter-clockwise is positive", anchor="middle")
    return sheet


def _toward(angle: float, share: float) -> Point:
    turned = math.radians(angle)
    return share * _RADIUS * math.cos(turned), share * _RADIUS * math.sin(turned)


def _ray(sheet: Sheet, angle: float, begin: float, end: float, style: str) -> None:
    sheet.path([_toward(angle, begin), _toward(angle, end)], style)


def _note(sheet: Sheet, angle: float, words: str, shift: Point, anchor: str) -> None:
    sheet.text(_toward(angle, 1.15), words, shift, anchor)
