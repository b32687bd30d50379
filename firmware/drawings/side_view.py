"""The hub from its right side: heights above the table, from the cones to the rails."""

from firmware.drawings import parts
from firmware.drawings.measures import COUPLING, LENS, MOTOR, MOTOR_SIDE, PLATE, PROFILE_HEIGHT
from firmware.drawings.sheet import Sheet, mm

_GREY = 'fill="#e8e8e8"'
HUB = LENS + parts.LENS_DROP
"""Height of the hub plate's lower face; what is above it follows."""
FACE = HUB + PLATE + COUPLING
CARRIAGE_PLATE = FACE + MOTOR
BEAM = CARRIAGE_PLATE + PLATE + 20.0
"""The beam's lower edge, with 20 mm for the carriage's wheels."""
RAIL = BEAM + PROFILE_HEIGHT + 20.0
TOP = RAIL + PROFILE_HEIGHT


def drawing() -> str:
    sheet = Sheet(800, 680, 1.5, (330, 630))
    sheet.text((0, 0), "The hub from its right side; measures in mm", (-310, -604))
    _frame(sheet)
    _hub(sheet)
    _table(sheet)
    _measures(sheet)
    return sheet.svg()


def _frame(sheet: Sheet) -> None:
    sheet.box((-150, BEAM), (190, BEAM + PROFILE_HEIGHT), _GREY)
    sheet.text((-140, BEAM + PROFILE_HEIGHT / 2), "beam, with the rail of x")
    sheet.box((130, RAIL), (170, TOP), _GREY)
    sheet.box((110, BEAM + PROFILE_HEIGHT), (190, RAIL), 'fill="#ccc"')
    sheet.text((105, RAIL + 40), "a rail of y; the beam hangs below its carriage", anchor="end")
    sheet.box((-50, CARRIAGE_PLATE), (50, CARRIAGE_PLATE + PLATE), 'fill="#ccc"')
    sheet.box((-40, CARRIAGE_PLATE + PLATE), (-20, BEAM + 5), 'fill="#ccc"')
    sheet.box((20, CARRIAGE_PLATE + PLATE), (40, BEAM + 5), 'fill="#ccc"')
    sheet.text((55, CARRIAGE_PLATE), "carriage of x")


def _hub(sheet: Sheet) -> None:
    half = MOTOR_SIDE / 2
    sheet.box((-half, FACE), (half, CARRIAGE_PLATE), _GREY)
    sheet.text((0, FACE + MOTOR / 2), f"alpha: {mm(MOTOR)}", (0, 4), "middle")
    sheet.box((-11, HUB + PLATE), (11, FACE), 'fill="#ccc"')
    sheet.text((14, HUB + PLATE + COUPLING / 2), f"coupling: {mm(COUPLING)}, with a shaft of 5 mm", (0, 4))
    sheet.box((parts.HUB_BACK, HUB), (parts.HUB_FRONT, HUB + PLATE), 'fill="#9c9"')
    sheet.box((parts.PI_BACK, HUB + PLATE + 6), (parts.PI_BACK + 85, HUB + PLATE + 8), _GREY)
    sheet.text((parts.PI_BACK, HUB + PLATE + 8), "Raspberry Pi", (0, -6))
    sheet.box((-1 - PLATE, parts.lowest()), (-1, HUB + PLATE), 'fill="#9c9"')
    sheet.box((-5, LENS - 4), (0, LENS + 4), 'fill="#000"')
    sheet.path([(0, 60), (0, BEAM + PROFILE_HEIGHT + 15)], 'stroke-dasharray="12 3 2 3" stroke-width="0.7"')
    sheet.text((0, BEAM + PROFILE_HEIGHT + 15), "axis of yaw", (0, -4), "middle")
    sheet.path([(0, LENS), (210, LENS)], 'stroke-dasharray="12 3 2 3" stroke-width="0.7"')
    sheet.text((36, LENS), "optical axis", (0, -5))
    sheet.text((-10, LENS), "camera plate", (0, -5), "end")
    sheet.text((parts.HUB_BACK, HUB), "hub plate", (2, 16))


def _table(sheet: Sheet) -> None:
    sheet.path([(-160, 0), (260, 0)], 'stroke-width="2"')
    for x, file, name in ((70, "cone.obj", "cone"), (150, "finish-cone.obj", "finish cone")):
        profile = parts.cone_profile(file)
        sheet.path([*((x + r, z) for r, z in profile), *((x - r, z) for r, z in reversed(profile))], _GREY, closed=True)
        sheet.text((x, 0), name, (0, 16), "middle")
    sheet.text((-150, 0), "table", (0, 16))


def _measures(sheet: Sheet) -> None:
    cone, finish = (parts.cone_profile(file)[-1][1] for file in ("cone.obj", "finish-cone.obj"))
    sheet.up(0, cone, 100, mm(cone), (0, 72))
    sheet.up(0, finish, 190, mm(finish), (0, 153))
    sheet.up(0, LENS, 215, f"{mm(LENS)}: lens", (0, 210))
    sheet.up(0, parts.lowest(), 42, mm(parts.lowest()), (0, -1))
    sheet.up(0, HUB, -160, mm(HUB), (0, parts.HUB_BACK))
    sheet.up(0, BEAM, -180, mm(BEAM), (0, -150))
    sheet.up(0, RAIL, 240, mm(RAIL), (0, 170))
    sheet.up(0, TOP, 262, mm(TOP), (0, 170))
    sheet.across(parts.HUB_BACK, 0, 60, mm(-parts.HUB_BACK), (HUB, LENS))
    sheet.across(0, parts.HUB_FRONT, 60, mm(parts.HUB_FRONT), (LENS, HUB))
