"""What is wrong with text that is not JSON, in our own words: a table of the mistakes that people make."""

import json
import re
from typing import Any, NamedTuple

from dodo_dsl.opendlv.inputs.problem import place_of_key

_TOKEN = re.compile(r'"(?:[^"\\\n]++|\\.)*+"|[][{}]')
_CLOSING = {"{": "}", "[": "]"}
_NEAR = 2000
"""Characters before and behind the place where Python's reader gives up that are looked at."""
_SHOWN = 30
_VALUES = "a value is a text in double quotes, a number, true, false, null, [...] or {...}"
_SLIPS = (
    (r"(?P<at>,)\s*\0(?P<sign>[]}])", "a comma before the closing '{sign}'", "remove it: JSON has none there"),
    (r"\0(?P<at>,)\s*(?P<sign>[]}])", "a comma before the closing '{sign}'", "remove it: JSON has none there"),
    (r"\0(?://|/\*|#)", "a comment, which JSON does not have", "remove it"),
    (r"\0['`\u201c\u201e]", "other quotation marks than JSON has", 'write "..."'),
    (r"\0(?P<at>\\.)", "'{at}' means nothing in JSON", "write \\\\ for a backslash, or / in a path"),
    (
        r'\0"(?:[^"\\\n]|\\.)*(?:\n|$)',
        "this quotation mark is not closed in its line",
        'write " at the end of the text',
    ),
    (r"\0[\x01-\x1f]", "a tab or another control character within a text", "write \\t, or a space"),
    (
        r"[{,]\s*\0(?P<at>[A-Za-z_][\w.-]*)",
        "'{at}' is no key, which is a text in double quotes",
        'write "{at}": and its value',
    ),
    (r"\0(?P<at>None|True|False)\b", "'{at}' is Python, not JSON", "write null, true or false"),
    (
        r'\{(?:[^{}]*,)?\s*"(?:[^"\\\n]|\\.)*(?P<at>")\s*\0[^:]',
        "':' is missing behind this key",
        "write ':' and its value",
    ),
    (r'(?P<at>[]}"])\s*\0[-"[{0-9tfn]', "a comma is missing behind this value", "write ',' here"),
    (r'(?P<at>[0-9a-z])\s+\0[-"[{0-9tfn]', "a comma is missing behind this value", "write ',' here"),
    (
        r"(?<![\w.])(?P<at>-?[0-9]*\0[-+]?[0-9]*\.?[0-9]*)(?<=[\d.])",
        "'{at}' is not a number of JSON",
        "write digits before and behind the point, as in 0.5, and no other zero or plus before them",
    ),
    (
        r"[0-9] *\0(?P<at>[A-Za-z%\u00b0/]+)",
        "'{at}' behind a value",
        "remove it: JSON has numbers without units, and other text in quotes",
    ),
)
"""Patterns of the text around that place, which is marked in it, with what to say about their group ``at``."""


class JsonError(ValueError):
    """Text that is not JSON, or has a key twice: what is wrong, with line and column from 1, and what to write."""

    def __init__(self, what: str, hint: str, line: int, column: int) -> None:
        super().__init__(what)
        self.what, self.hint, self.line, self.column = what, hint, line, column


class _Slip(NamedTuple):
    """A mistake; ``at`` is its place in the text, from 0."""

    at: int
    what: str
    hint: str = ""


class _Twice(ValueError):
    """An object has this key twice."""


def loads(text: str) -> Any:
    """The JSON of a text; raises JsonError, RecursionError, and ValueError for a number of too many digits."""
    ended = 0

    def once(pairs: list[tuple[str, object]]) -> dict[str, object]:
        nonlocal ended
        ended += 1
        if len(found := dict(pairs)) < len(pairs):
            names = [name for name, _ in pairs]
            raise _Twice(next(name for at, name in enumerate(names) if name in names[:at]))
        return found

    try:
        return json.loads(text, object_pairs_hook=once)
    except json.JSONDecodeError as error:
        slip = _slip(text, error.pos)
    except _Twice as twice:
        slip = _second(text, ended, str(twice))
    line = text.count("\n", 0, slip.at) + 1
    raise JsonError(slip.what, slip.hint, line, slip.at - text.rfind("\n", 0, slip.at))


def _second(text: str, number: int, name: str) -> _Slip:
    """The key that the object has twice which is the one to end as this ``number``, counted from 1."""
    begin = _brackets(text)[1][number - 1]
    what = f"the key {json.dumps(name, ensure_ascii=False)} appears twice in one object"
    return _Slip(place_of_key(text, begin, name), what, "keep one of them: only the last would count")


def _brackets(text: str) -> tuple[list[int], list[int]]:
    """Where brackets begin that are not closed, and where objects do that are, in the order in which they end."""
    open_, objects = list[int](), list[int]()
    for token in _TOKEN.finditer(text):
        if token[0] in _CLOSING:
            open_.append(token.start())
        elif token[0] in "]}" and open_:
            begin = open_.pop()
            objects.extend([begin] if text[begin] == "{" else [])
    return open_, objects


def _slip(text: str, at: int) -> _Slip:
    if not text.strip():
        return _Slip(0, "the file is empty, expected JSON", "an object begins with { and ends with }")
    begin = max(0, at - _NEAR)
    near = f"{text[begin:at]}\0{text[at : at + _NEAR]}"
    for pattern, what, hint in _SLIPS:
        if found := re.search(pattern, near):
            place = found.start("at") if "at" in found.groupdict() else found.start() + found[0].index("\0") + 1
            words = {name: word.replace("\0", "")[:_SHOWN] for name, word in found.groupdict().items()}
            return _Slip(begin + place - near.count("\0", 0, place), what.format(**words), hint.format(**words))
    if slip := _of_brackets(text, at):
        return slip
    word = re.match(r"[-+.\w]+|.|$", text[at : at + _SHOWN], re.DOTALL)
    return _Slip(at, f"not JSON: '{word[0] if word else ''}' is not expected here", _VALUES)


def _of_brackets(text: str, at: int) -> _Slip | None:
    open_, sign = _brackets(text[:at])[0], text[at : at + 1]
    if open_ and not text[at:].strip():
        bracket = text[open_[-1]]
        return _Slip(open_[-1], f"'{bracket}' is not closed", f"write '{_CLOSING[bracket]}' where it ends")
    if open_ and sign in ("}", "]") and sign != (closing := _CLOSING[text[open_[-1]]]):
        what = f"'{sign}' does not close '{text[open_[-1]]}' of line {text.count(chr(10), 0, open_[-1]) + 1}"
        return _Slip(at, what, f"write '{closing}' before it, or remove '{sign}' if it is too many")
    if not open_ and text[:at].strip():
        return _Slip(at, f"'{sign}' follows the end of the JSON", "remove it, or the bracket too many before it")
    return None
