"""Rules on the files that parameters name, and on the limits by which evaluators judge."""

import functools
import json
import math
from collections.abc import Iterator, Mapping
from pathlib import Path

from dodo_dsl.check import wiring
from dodo_dsl.check.resolve import IMAGE, RuleContext, known_ids, without_pictures
from dodo_dsl.diagnostics import Diagnostic, Severity, Span, did_you_mean, has_errors
from dodo_dsl.opendlv import regular_file
from dodo_dsl.opendlv.assets import formats, map_file, recording_contents
from dodo_dsl.opendlv.assets.problem import InputError
from dodo_dsl.source import MAX_PROBLEMS, Entry, Scalar, Sequence
from dodo_dsl.spec.arguments import Argument, ResolvedService
from dodo_dsl.spec.manifest import Parameter
from dodo_dsl.spec.registry import SUFFIX

RULE = "wrong-file"
MAX_FILES = 5_000
MAX_BYTES = 2 << 30
_TEXT = (".json", ".csv", ".obj", ".txt", ".yml", ".yaml")
"""Endings of files whose lines can be shown."""


def check_files(context: RuleContext) -> Iterator[Diagnostic]:
    """What files hold; ``path-escape``: what a test needs is not too much, and no link out of the registry."""
    for service in context.services:
        for argument in service.arguments.values():
            yield from file_problems(context, service, argument)
            if argument.entry and argument.value and argument.value.path:
                found = needed(argument.parameter, argument.value.path, context.spec.location.root)
                if isinstance(found, str):
                    yield Diagnostic(argument.entry.key, "path-escape", found)


def needed(parameter: Parameter, path: Path, root: Path) -> Mapping[str, Path] | str:
    is_map = parameter.format == "map" and path.suffix == ".json"  # its meshes stand beside it
    return files(path.parent if is_map else path, root)


@functools.lru_cache(maxsize=256)
def files(path: Path, root: Path) -> Mapping[str, Path] | str:
    """The real paths of the file, or of all in the folder but hidden ones, by where they lie below ``root``.

    Or what is wrong with them.
    """
    root = root.resolve()
    found: dict[str, Path] = {}
    size = 0
    for file in (path,) if path.is_file() else sorted(path.rglob("*")):
        if not file.is_file() or any(p.startswith(".") or p == "__pycache__" for p in file.relative_to(path).parts):
            continue
        found[file.relative_to(root).as_posix()] = real = file.resolve()
        if not real.is_relative_to(root):
            return f"'{file.relative_to(root)}' is a symbolic link that leaves the registry"
        size += real.stat().st_size
        if len(found) > MAX_FILES or size > MAX_BYTES:
            return f"'{path.relative_to(root)}' holds more than {MAX_FILES} files or {MAX_BYTES >> 30} GiB"
    return found


def is_own(diagnostic: Diagnostic) -> bool:
    """Whether a problem is one of a file that several tests name, and the same in each of them."""
    return diagnostic.rule == RULE and not diagnostic.span.file.endswith(SUFFIX)


def file_problems(context: RuleContext, service: ResolvedService, argument: Argument) -> tuple[Diagnostic, ...]:
    name, path = argument.parameter.format, argument.value.path if argument.value else None
    if not name or path is None:
        return ()
    given = tuple((key, service.texts.get(key, "")) for key in formats.FORMATS[name].settings)
    return problems(name, path, given, context.deployment.messages)


@functools.lru_cache(maxsize=1024)
def problems(
    name: str, path: Path, given: tuple[tuple[str, str], ...], own: tuple[Path, ...]
) -> tuple[Diagnostic, ...]:
    ids: Mapping[str, int] = known_ids(own)
    return tuple(
        _diagnostic(error, formats.FORMATS[name].help) for error in formats.problems(name, path, dict(given), ids)
    )


def _diagnostic(error: InputError, help_: str) -> Diagnostic:
    line, column = error.position()
    is_text = error.file.suffix in _TEXT
    span = Span(str(error.file), line, column, 1 if is_text else 0)
    return Diagnostic(span, RULE, error.what, error.hint or help_, "warning" if error.is_slip else "error")


MAP = "map.json"
"""The map in its folder."""
_MAX_BYTES = 20 << 20
_CLASSES, _OBSTACLES = "categories", "obstacles"
_HELP = {"obstacles": "see docs/reference/maps.md"}
_PLURAL = {"block": "blocks"}


def check_references(context: RuleContext) -> Iterator[Diagnostic]:
    for service in context.services:
        for name, entry in service.use.parameters.items():
            argument = service.arguments.get(name)
            if argument and argument.value and argument.parameter.among:
                yield from _among(context, service, argument, entry)
            if argument and argument.value and argument.parameter.within_timeout:
                yield from _within(context, service, argument.value.text, entry)


def _among(context: RuleContext, service: ResolvedService, argument: Argument, entry: Entry) -> Iterator[Diagnostic]:
    """``map-path.obstacles|block`` names a parameter with a JSON file, and lists of that file."""
    source, _, lists = argument.parameter.among.partition(".")
    keys, path = lists.split("|"), argument.value and service.arguments[source].value
    if not path or not path.path or has_errors(file_problems(context, service, service.arguments[source])):
        return  # reported with the file
    file = path.path / MAP if path.path.is_dir() else path.path
    shown = f"{file.parent.name}/{file.name}"
    try:
        names = [*filter(None, (name for key in keys for name in entries(file, key))), *argument.parameter.words]
    except ValueError as error:
        yield Diagnostic(entry.value.span, "wrong-file", f"{shown}: {error}", _HELP.get(keys[0], ""))
        return
    items = entry.value.items if isinstance(entry.value, Sequence) else (entry.value,)
    for item in items[:MAX_PROBLEMS]:
        if isinstance(item, Scalar) and item.text not in names:
            of = " and ".join(_PLURAL.get(key, key) for key in keys)
            message, hint = f"'{item.text}' is not among the {of} of {shown}", did_you_mean(item.text, names)
            yield Diagnostic(item.span, "unknown-name", message, hint)


@functools.lru_cache(maxsize=256)
def entries(file: Path, key: str) -> tuple[str, ...]:
    """The entries of a list in a JSON file by name, empty for those that have none; raises ValueError.

    A class may be written with ``color:`` before its name, as in messages.
    """
    try:
        is_walls = file.suffix == map_file.WALLS
        document = map_file.document_of(file) if is_walls else json.loads(regular_file.text(file, _MAX_BYTES))
    except OSError as error:
        raise ValueError(f"cannot be read: {error.strerror}") from error
    except (ValueError, RecursionError) as error:
        raise ValueError(f"not JSON: {str(error)[:120]}") from error
    found = document.get(key, []) if isinstance(document, dict) else None
    if not isinstance(found, list):
        raise ValueError(f"expected an object with a list '{key}'")  # noqa: TRY004  (of the file)
    plain, unnamed = _plain if key == _CLASSES else str, map_file.numbered if key == _OBSTACLES else lambda _: ""
    return tuple(
        plain(e["name"]) if isinstance(e, dict) and "name" in e else unnamed(n) for n, e in enumerate(found, 1)
    )


def _plain(name: object) -> str:
    return str(name).strip().removeprefix("color:").strip()


def _within(context: RuleContext, service: ResolvedService, seconds: str, entry: Entry) -> Iterator[Diagnostic]:
    timeout = context.spec.timeout_s
    if timeout is not None and float(seconds) >= timeout:
        written = entry.value.text if isinstance(entry.value, Scalar) else seconds
        message = f"'{service.use.name}' waits up to {written}, but the test's timeout of {timeout:g} s ends it first"
        hint = "use a longer timeout, so that the evaluator can judge"
        yield Diagnostic(entry.value.span, "short-timeout", message, hint, "warning")


_SINCE_1970 = 1e8
"""Seconds; larger times count from 1970."""
_CLOSE = 1e-9

Unmet = tuple[str, str, str, Severity]
"""A parameter that what the test shows cannot meet, why in words behind the service's name, and a hint."""


def check_input(context: RuleContext) -> Iterator[Diagnostic]:
    """In lockstep a frame has one answer, with its sample time; else an application may answer as often as it likes."""
    spec, services = context.spec, context.services
    unsure: Severity = "error" if spec.clock == "lockstep" else "warning"
    player = next((s for s in services if "rec" in s.texts and s.use.layer == "environment"), None)
    others = (s for s in services if s is not player and s.use.layer == "environment")
    is_blind = player and without_pictures(player) and not any(s.manifest.memory.outputs for s in others)
    known = wiring.rates(services)
    has_rate = not player and known.keys() & wiring.cameras_of(context.wiring)
    period = 1 / wiring.step_hz(context.wiring, known) if has_rate else 0.0
    for service in services if context.test.is_complete else ():
        found: list[Unmet] = []
        for name, argument in service.arguments.items():
            is_default = argument.parameter.within_timeout and not argument.entry and argument.text
            if is_default and spec.kind != "closed-loop" and float(argument.text or 0) < (spec.timeout_s or 0.0):
                why = f"judges {argument.text} s of the test's {spec.timeout_s:g} s, as nothing ends the input"
                found.append((name, why, f"write '{name}: ...', how long it is to judge", "warning"))
        if service.use.layer == "evaluation":
            if is_blind and "min-frames" in service.texts and not service.texts.get("freq"):
                why = "judges answers to frames, and the recording that is played has none"
                found.append(("min-frames", why, "play a recording with frames", "error"))
            found += [*_times(service, player, unsure), *_frames(service, player, period, unsure)]
        for name, why, hint, severity in found:
            entry = service.use.parameters.get(name)
            span = entry.value.span if entry else service.use.span
            yield Diagnostic(span, "input-limit", f"'{service.use.name}' {why}", hint, severity)


def _times(service: ResolvedService, player: ResolvedService | None, unsure: Severity) -> Iterator[Unmet]:
    is_copied = service.texts.get("align") == "sample-time" and "target" in service.texts
    if player and "align" in service.texts and player.texts.get("sample-times") == "recorded" and not is_copied:
        why = f"expects samples with times of the test, and frames of '{player.use.name}' keep those of the recording"
        hint = f"write 'sample-times: test' under 'with' of '{player.use.name}'"
        yield "align", why, hint, "warning" if without_pictures(player) else unsure
    if judged := _judged(service):
        first, begin, end = judged
        if begin >= end:
            why = f"has nothing to judge: the target begins at {first:,.10g} s, judged is {begin:,.10g} to {end:.10g} s"
            hint = "write 'align: sample-time' for times since 1970" if first > _SINCE_1970 else "see from and until"
            yield "target", why, hint, "error"
        elif is_copied and first < _SINCE_1970:
            why = f"aligns by sample times, which count from 1970, and its target begins at {first:g} s"
            yield "target", why, "write 'align: begin' for seconds since the start of the test", "error"


def _judged(service: ResolvedService) -> tuple[float, float, float] | None:
    """When a table begins, and what of it is judged from when to when, in s; None where that is not known."""
    texts, target = service.texts, service.arguments.get("target")
    path = target.value.path if target and target.value else None
    found = table_span(path, texts.get("target-field") or texts.get("field", "")) if path else None
    if found is None:
        return None
    is_copied = texts.get("align") == "sample-time"
    begin, end = (0.0, found[1] - found[0]) if is_copied else found
    limits = [float(texts[name]) for name in ("until", "max-time")[: 1 if is_copied else 2] if name in texts]
    return found[0], max(begin, float(texts.get("from", 0))), min(end, *limits, end)


@functools.lru_cache(maxsize=256)
def table_span(path: Path, field: str) -> tuple[float, float] | None:
    """When a table of a target begins and ends, in s; None for a recording and a table that cannot be read."""
    if path.suffix == formats.RECORDING:
        return None
    from dodo_dsl.opendlv.assets.table import read_target
    from dodo_dsl.opendlv.envelope import MICROSECONDS

    try:
        times = [time / MICROSECONDS for time, _ in read_target(path, field)]
    except InputError:
        return None  # reported with the file
    return times[0], times[-1]


def _frames(
    service: ResolvedService, player: ResolvedService | None, period: float, unsure: Severity
) -> Iterator[Unmet]:
    """More answers than there are frames in a recording or each ``period`` s, and a gap that is shorter than that."""
    texts, judged = service.texts, _judged(service)
    name = "min-samples" if "min-samples" in texts else "min-frames"
    least = most = int(texts.get(name, 0))
    path = player.arguments["rec"].value if player else None
    if player and path and path.path and unsure == "error":
        most = pictures(path.path, int(player.texts.get("video-sender", 0)), least)
    elif period and judged and judged[1] < judged[2]:
        most = math.floor(judged[2] / period + _CLOSE) - math.ceil(judged[1] / period - _CLOSE) + 1
    elif period and name == "min-frames" and {"max-delay", "max-time"} <= texts.keys():
        wait = 0.0 if "message" in texts else float(texts["max-delay"])  # responds counts an answer when it comes
        most = math.floor((float(texts["max-time"]) - wait) / period + _CLOSE) + 1
    if most < least:
        why = f"expects {least} answers, and what it judges has {most} frame{'' if most == 1 else 's'}"
        yield name, why, f"write '{name}: {most}' or less", unsure
    gap = service.arguments.get("max-gap")
    if gap and gap.text and not gap.parameter.shared and float(gap.text) < period - _CLOSE:
        why = f"expects an answer each {float(gap.text):g} s, and frames come each {period:g} s"
        yield "max-gap", why, f"write 'max-gap: {period:g} s' or more", unsure


@functools.lru_cache(maxsize=256)
def pictures(path: Path, sender: int, most: int) -> int:
    """How many frames of a camera a recording has, up to so many; so many if it has none, or is damaged."""
    try:
        found = recording_contents.contents(path)
    except OSError:
        return most  # reported with the file
    count = found.counts.get((known_ids(())[IMAGE], sender), 0)
    return min(count, most) if count and found.is_whole else most


def check_limits(context: RuleContext) -> Iterator[Diagnostic]:
    for service in context.services:
        for names in service.manifest.one_of:
            if not any(name in service.use.parameters or service.texts.get(name) for name in names):
                message = f"'{service.use.name}' has nothing to judge by"
                hint = f"write one or more of {', '.join(names)} under 'with'"
                yield Diagnostic(service.use.span, "no-limit", message, hint)
