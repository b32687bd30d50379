"""The wiring between controller, drivers and switches: pins of the firmware's source, drivers of its table."""

import re
from itertools import pairwise
from pathlib import Path

import yaml

from firmware.drawings.sheet import Sheet

FIRMWARE = Path(__file__).parents[1]
_WIDTH, _TOP, _BOTTOM = 150.0, 340.0, 200.0
_GREY, _THIN = 'fill="#e8e8e8"', 'stroke-width="1"'
_BUSES = {
    "DRIVERS_ALIVE": ("STBY/RST", 480.0, 112.0),
    "SELECT": ("CSN", 450.0, 62.0),
    "DATA_CLOCK": ("CK", 420.0, 25.0),
}
"""By the pin's name in the firmware: the drivers' pin, the height of the line, and where the pin is on a driver."""
_CHAIN, _RETURN, _CLOCK = 305.0, 390.0, 270.0
_SUPPLY = 30.0


def pins() -> dict[str, str]:
    """The UNO's pin, such as D10, of each name in the firmware's source."""
    source = (FIRMWARE / "gantry" / "avr" / "main.c").read_text()
    return dict(re.findall(r"#define (\w+) P[BD]\d +/\* (D\d+)", source))


def motors() -> list[str]:
    """The drivers in the order of the chain."""
    return list(yaml.safe_load((FIRMWARE / "protocol.yml").read_text())["drivers"]["motors"])


def drawing() -> str:
    sheet = Sheet(1000, 580, 1.0, (10, 570))
    sheet.text((10, 546), "Wiring of a rig of the kind dynamic; crossing lines are connected if there is a dot")
    lefts = {name: 260.0 + 180.0 * place for place, name in enumerate(motors())}
    _controller(sheet, lefts)
    for name, left in lefts.items():
        _driver(sheet, name, left)
    _chain(sheet, list(lefts.values()))
    _supply(sheet, max(lefts.values()) + 70)
    return sheet.svg()


def _controller(sheet: Sheet, lefts: dict[str, float]) -> None:
    sheet.box((10, _BOTTOM), (150, 500), _GREY)
    sheet.text((20, 482), "UNO")
    sheet.text((20, 225), "USB: host")
    sheet.text((20, 209), "GND: all GND")
    found, last = pins(), max(lefts.values())
    for name, (_, height, right) in _BUSES.items():
        sheet.text((144, height), found[name], (0, 4), "end")
        sheet.path([(150, height), (last + right, height)], _THIN)
    sheet.text((144, _CHAIN), found["DATA_OUT"], (0, 4), "end")
    sheet.text((144, _RETURN), found["DATA_IN"], (0, 4), "end")
    sheet.box((165, 474), (200, 486), 'fill="#fff"')
    sheet.text((182, 480), "330 Ohm", (0, -9), "middle")
    for x, height, words in ((225.0, 480.0, "1 uF and 220 kOhm, each to GND"), (470.0, 450.0, "10 kOhm to 5 V")):
        sheet.path([(x, height), (x, 510)], _THIN)
        _dot(sheet, x, height)
        sheet.text((x, 510), words, (6, 2))


def _driver(sheet: Sheet, name: str, left: float) -> None:
    sheet.box((left, _BOTTOM), (left + _WIDTH, _TOP), _GREY)
    sheet.text((left + 75, 240), f"L6470 {name}", (0, 4), "middle")
    for word, height, right in _BUSES.values():
        sheet.path([(left + right, height), (left + right, _TOP)], _THIN)
        _dot(sheet, left + right, height)
        sheet.text((left + right, _TOP), word, (0, 14), "middle")
    for word, right in (("SW", 25.0), ("VS", 70.0), ("motor", 120.0)):
        sheet.text((left + right, _BOTTOM), word, (0, -5), "middle")
    for word, height in (("SD", _CHAIN), ("OSC", _CLOCK)):
        sheet.text((left, height), word + ("I" if word == "SD" else "IN"), (5, 4))
        sheet.text((left + _WIDTH, height), word + ("O" if word == "SD" else "OUT"), (-5, 4), "end")
    sheet.path([(left + 120, _BOTTOM), (left + 120, 166)], _THIN)
    sheet.circle((left + 120, 150), 16)
    sheet.text((left + 120, 150), "M", (0, 4), "middle")
    sheet.path([(left + 70, _BOTTOM), (left + 70, _SUPPLY)], _THIN)
    _dot(sheet, left + 70, _SUPPLY)
    _switches(sheet, left + 25)


def _switches(sheet: Sheet, middle: float) -> None:
    """Two in parallel, normally open."""
    sheet.path([(middle, _BOTTOM), (middle, 170)], _THIN)
    sheet.path([(middle - 18, 150), (middle - 18, 170), (middle + 18, 170), (middle + 18, 150)], _THIN)
    sheet.path([(middle - 18, 130), (middle - 18, 110), (middle + 18, 110), (middle + 18, 130)], _THIN)
    for x in (middle - 18, middle + 18):
        sheet.path([(x, 130), (x - 9, 149)], 'stroke="#c00" stroke-width="1.5"')
    sheet.path([(middle, 110), (middle, 95)], _THIN)
    sheet.text((middle, 95), "GND", (0, 12), "middle")
    sheet.text((middle, 70), "home, far", (0, 4), "middle")


def _chain(sheet: Sheet, lefts: list[float]) -> None:
    sheet.path([(150, _CHAIN), (lefts[0], _CHAIN)], _THIN)
    for one, other in pairwise(lefts):
        for height in (_CHAIN, _CLOCK):
            sheet.path([(one + _WIDTH, height), (other, height)], 'stroke-width="1" marker-end="url(#end)"')
    end = lefts[-1] + _WIDTH
    sheet.path([(end, _CHAIN), (end + 20, _CHAIN), (end + 20, _RETURN), (150, _RETURN)], _THIN)


def _supply(sheet: Sheet, end: float) -> None:
    sheet.path([(40, _SUPPLY), (end, _SUPPLY)], _THIN)
    sheet.text((10, _SUPPLY), "12 V", (0, 4))
    for left, words in ((55.0, "fuse"), (115.0, "emergency stop")):
        width = 45.0 if words == "fuse" else 110.0
        sheet.box((left, _SUPPLY - 11), (left + width, _SUPPLY + 11), 'fill="#fff"')
        sheet.text((left + width / 2, _SUPPLY), words, (0, 4), "middle")


def _dot(sheet: Sheet, x: float, y: float) -> None:
    sheet.circle((x, y), 3, 'fill="#000"')
