"""What values mean that are no quantities as they are written."""

from collections.abc import Callable, Collection

from dodo_dsl.diagnostics import Fix

_ALIASES = {
    "°": "deg",
    "°/s": "deg/s",
    "µs": "us",
    "sec": "s",
    "m/s²": "m/s2",
    "m/s^2": "m/s2",
    "rad/s²": "rad/s2",
    "rad/s^2": "rad/s2",
    "deg/s²": "deg/s2",
    "deg/s^2": "deg/s2",
}
_WORDS = {"yes": "true", "y": "true", "on": "true", "no": "false", "n": "false", "off": "false"}
_MINUS = "\u2212\u2010\u2011\u2012\u2013\u2014"


def repaired(text: str, fits: Callable[[str], bool]) -> tuple[str, Fix | None]:
    """A hint how to write a value so that it ``fits``, and the only fix; empty and None where nothing does."""
    before = text.partition("#")[0]
    if "#" in text and fits(before):
        return "a comment begins with ' #', after a space", Fix("#", " #")
    bare = text.rstrip(",; ")
    if bare != text and fits(bare):
        return f"write '{bare}', without '{text[len(bare) :].strip()}'", Fix(text, bare)
    hyphen = f"-{text[1:]}"
    if text[:1] in _MINUS and text and fits(hyphen):
        return f"write '{hyphen}', with a hyphen for the minus sign", Fix(text, hyphen)
    return "", None


def unit_meant(written: str, text: str, units: Collection[str]) -> Fix | None:
    """The only unit of some that one of a ``text`` means: in other letters, or as it is written elsewhere."""
    meant = {unit for unit in units if unit.lower() == written.lower() or unit == _ALIASES.get(written)}
    if len(meant) != 1:
        return None
    unit = meant.pop()
    return Fix(written, unit if f" {written}" in text else f" {unit}")


def boolean_meant(text: str) -> tuple[str, Fix | None]:
    """A hint for a word that other readers of YAML take for true or false, and the fix; empty and None for others."""
    meant = _WORDS.get(text.lower(), "")
    return (f"write {meant}", Fix(text, meant)) if meant else ("", None)
