"""JSON files as typed values, so that every error names its file, its place and what was expected."""

import difflib
import functools
import json
import re
from collections.abc import Callable, Collection, Iterable, Iterator
from pathlib import Path
from typing import Annotated, Any, TypeVar

import msgspec
from msgspec import Meta, Struct

from dodo_dsl.opendlv import regular_file
from dodo_dsl.opendlv.assets.problem import InputError

MAX_NUMBER = 100_000.0
Number = Annotated[float, Meta(ge=-MAX_NUMBER, le=MAX_NUMBER)]
Text = Annotated[str, Meta(pattern=r"^\S(.*\S)?$")]
T = TypeVar("T")

_KINDS = {"array": "a list", "object": "an object", "float": "a number", "int": "a whole number", "str": "a text"}
_BYTE = re.compile(r"(?:JSON is malformed: )?(.*?)(?: \(byte (\d+)\))?")
_PLACED = re.compile(r"(.*?)(?: - at `\$(.*)`)?", re.DOTALL)


def read_bytes(path: Path) -> bytes:
    try:
        return regular_file.content(path)
    except OSError as error:
        raise InputError(path, f"cannot be read: {error.strerror}") from None


def load(file: Path) -> Any:
    """The document in a file, which no reader changes; raises InputError."""
    return _document(file, read_bytes(file))


@functools.lru_cache(maxsize=2)
def _document(file: Path, data: bytes) -> Any:
    try:
        text = data.decode("utf-8-sig")
        value = msgspec.json.decode(text)
        place = next(_repeated(text), "")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise InputError(file, f"byte {error.start} is not UTF-8 text", line=line) from None
    except RecursionError:
        raise InputError(file, "the JSON is nested too deeply") from None
    except msgspec.ValidationError as error:
        raise _wrong(file, None, "$", error) from None
    except msgspec.DecodeError as error:
        match = _BYTE.fullmatch(str(error))
        what, at = match.groups() if match else (str(error), None)
        before = data.removeprefix(b"\xef\xbb\xbf")[: int(at) if at else None].decode(errors="replace")
        line, column = before.count("\n") + 1, len(before) - before.rfind("\n")
        raise InputError(file, f"not JSON: {what[:1].lower()}{what[1:]}", line=line, column=column) from None
    if place:
        what = f"the key '{place.rpartition('.')[2]}' appears twice in one object"
        raise InputError(file, what, place, hint="keep one of them: only the last would count")
    return value


def _repeated(text: str) -> Iterator[str]:
    """The paths of keys that stand twice in their objects, which are lost when JSON becomes a dict."""
    is_doubtful = False

    def once(pairs: list[tuple[str, object]]) -> tuple[tuple[str, object], ...]:
        nonlocal is_doubtful
        is_doubtful |= len(dict(pairs)) < len(pairs)
        return tuple(pairs)

    document = json.loads(text, object_pairs_hook=once, parse_int=str, parse_float=str)
    if is_doubtful:
        yield from _repeated_in(document, "$")


def _repeated_in(value: object, place: str) -> Iterator[str]:
    names = set[object]()
    for name, inner in value if isinstance(value, tuple) else ():
        if name in names:
            yield f"{place}.{name}"
        names.add(name)
        yield from _repeated_in(inner, f"{place}.{name}")
    for number, inner in enumerate(value if isinstance(value, list) else ()):
        yield from _repeated_in(inner, f"{place}[{number}]")


def converted(
    file: Path,
    value: object,
    kind: type[T],
    where: str = "$",
    hook: Callable[[type, Any], Any] | None = None,
    strict: bool = True,
) -> T:
    """A value at a place in a file as a type; raises InputError. Numbers may be texts unless it is ``strict``.

    ``hook`` makes types that JSON does not have. It and the structs raise ValueError with a sentence, perhaps a hint.
    """
    try:
        return msgspec.convert(value, kind, dec_hook=hook, strict=strict)
    except msgspec.ValidationError as error:
        raise _wrong(file, value, where, error, getattr(kind, "__struct_encode_fields__", ())) from None


def _wrong(
    file: Path, value: Any, where: str, error: msgspec.ValidationError, known: Collection[str] = ()
) -> InputError:
    """What msgspec says of a value, in words of JSON."""
    match, hint = _PLACED.fullmatch(str(error)), ""
    what, inner = (match[1], match[2] or "") if match else (str(error), "")
    if error.__cause__:
        what, hint = (*error.__cause__.args, "")[:2]
    elif key := re.fullmatch(r"Object missing required field `(.*)`", what):
        what = f"'{key[1]}' is missing"
    elif key := re.fullmatch(r"Object contains unknown field `(.*)`", what):
        what, inner, hint = f"nothing reads '{key[1]}'", f"{inner}.{key[1]}", near(key[1], known)
    else:
        kinds = re.sub(
            r", got .*| \| null", "", re.sub(r" matching.*", ", not empty and without blanks around it", what)
        )
        what = re.sub(r"`(.*?)`", lambda kind: _KINDS.get(kind[1], kind[1]), kinds)
    if what.lower().startswith("expected"):
        for index, key in re.findall(r"\[([0-9]+)\]|\.([^.\[]+)", inner):
            value = value[int(index) if index else key]
        what = f"{what[:1].lower()}{what[1:]}, found {json.dumps(value):.60}"
    return InputError(file, what, where + inner, hint=hint)


def near(word: str, known: Iterable[str]) -> str:
    """A hint that names the known word that is spelt alike; empty if there is none."""
    close = difflib.get_close_matches(word, sorted(known), n=1, cutoff=0.7)
    return f"did you mean '{close[0]}'?" if close else ""


def unread(file: Path, document: dict[str, Any], lists: dict[str, type[Struct]]) -> Iterator[InputError]:
    """Keys of a document, and of the entries of its lists, that nothing reads, each once."""
    yield from _unread(file, [("$", document)], lists)
    for key, kind in lists.items():
        listed = document[key] if isinstance(document.get(key), list) else []
        entries = [(f"$.{key}[{number}]", each) for number, each in enumerate(listed)]
        yield from _unread(file, entries, kind.__struct_encode_fields__)


def _unread(file: Path, objects: Iterable[tuple[str, Any]], known: Collection[str]) -> Iterator[InputError]:
    told = {*known}
    for place, value in objects:
        for key in [each for each in value if each not in told] if isinstance(value, dict) else ():
            told.add(key)
            hint = near(key, known) or f"known: {', '.join(known)}"
            yield InputError(file, f"nothing reads '{key}'", f"{place}.{key}", hint=hint, is_slip=True)
