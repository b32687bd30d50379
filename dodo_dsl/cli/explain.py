"""dodo explain: explain a rule, or how a test is wired and what its application must provide."""

import argparse
import os
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict
from itertools import groupby
from operator import itemgetter
from typing import Any, TextIO

from dodo_dsl.application.model import ApplicationSource
from dodo_dsl.check import catalogue
from dodo_dsl.check.resolve import ResolvedTest
from dodo_dsl.check.ros_topics import Resolved
from dodo_dsl.check.senders import told, told_in_words
from dodo_dsl.check.wiring import ANYTHING, End, Port, Wiring
from dodo_dsl.cli import selection
from dodo_dsl.cli.display import write_diagnostics
from dodo_dsl.cli.errors import Exit, UsageError
from dodo_dsl.diagnostics import Span, did_you_mean, shown_path
from dodo_dsl.run import application_time
from dodo_dsl.source import plain
from dodo_dsl.spec.arguments import Argument, default_value
from dodo_dsl.spec.model import LEVEL_WORDS, Spec, Use
from dodo_dsl.spec.quantity import SHARE
from dodo_dsl.spec.rig import EMULATED_FILE
from dodo_dsl.terminal import json_text, printable

EXAMPLES = """examples:
  dodo explain                       all rules, one line each
  dodo explain wrong-unit            a rule: its reason, what breaks it and what complies
  dodo explain sil-closed-straight   a test: services, origins of values, producers and consumers
  dodo explain 'sil-*' --json        several tests, as JSON
"""

_MOST_ROWS = 100

Explanation = dict[str, Any]
"""What ``dodo explain --json`` has of a test, with its keys; ``told`` is what it gets of what only a simulation has."""


def add(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("word", nargs="?", metavar="TEST|RULE", help="a rule, or the name or path of a test")
    parser.add_argument("--json", action="store_true", help="output as JSON")
    selection.add_application(parser)


def main(options: argparse.Namespace, stdout: TextIO, stderr: TextIO) -> int:
    rules = catalogue.pages()
    if options.word is None:
        table = _table([[page.name, page.summary] for page in rules.values()], "")
        stdout.write(json_text(list(map(_page, rules.values()))) if options.json else table)
        return Exit.OK
    if options.word in rules:
        page = rules[options.word]
        stdout.write(json_text(_page(page)) if options.json else catalogue.text(page))
        return Exit.OK
    try:
        checked = selection.select([options.word], (), options.application)
    except selection.NoSuchTest as error:
        near = did_you_mean(options.word, rules) if "-" in options.word else ""
        said = str(error).replace("unknown test", "unknown test or rule", 1)
        raise UsageError(f"{said}; " + (f"or the rule: {near}" if near else "'dodo explain' lists the rules")) from None
    found = [explain(test, checked.application) for test in checked.tests]
    files = groupby(found, itemgetter("file"))
    stdout.write(json_text(found) if options.json else "\n".join(_file(list(instances)) for _, instances in files))
    stderr.write(selection.left_out(checked))
    write_diagnostics(stderr, checked.diagnostics)
    return Exit.OK if checked.ok else Exit.USAGE


def _page(page: catalogue.Page) -> dict[str, str]:
    return asdict(page)


def explain(test: ResolvedTest, application: ApplicationSource | None = None) -> Explanation:
    """One instance with the application, as far as they can be read."""
    spec, wiring = test.spec, test.wiring
    services = [
        {"layer": use.layer, "name": use.name, "uses": use.uses.text, "arguments": list(_arguments(test, use))}
        for use in spec.uses
    ]
    variables = [
        {"name": name, "value": test.variables.get(name, "?"), "unit": "", "origin": _place(entry.key)}
        for name, entry in spec.variables.items()
    ]
    vary = [
        {"name": one.name, "nominal": one.nominal.text, "values": one.text, "origin": _place(one.nominal.span)}
        for one in spec.ranges
    ]
    return {
        "name": spec.title,
        "slug": spec.slug,
        "file": shown_path(str(spec.path)),
        "level": spec.level or "?",
        "kind": spec.kind or "?",
        "clock": _clock(spec, application),
        "rig": spec.rig or "",
        "pool": spec.pool,
        "services": services,
        "variables": variables,
        "vary": vary,
        "wiring": list(_lines(wiring)),
        "asked": list(_asked(wiring)),
        "topics": [*map(_topic, wiring.topics)],
        "told": list(dict.fromkeys(str(end.port) for end in told(wiring))),
        "has_application": wiring.has_application,
        "undeclared": list(wiring.undeclared),
    }


def _clock(spec: Spec, application: ApplicationSource | None) -> str:
    """The test's clock, and why it is lockstep by answers where a program that is started as a process says so."""
    if application is None or not spec.is_stepped:
        return spec.clock
    for service in application.services.values():
        words = plain(service.node).get("x-dodo-process") or ()
        for word in words[:1]:
            if why := application_time.refusal(service.name, str(word), os.environ, application.folder):
                return f"{spec.clock} by answers: {why}"
    return spec.clock


def _arguments(test: ResolvedTest, use: Use) -> Iterator[dict[str, str]]:
    for argument in next((s.arguments.values() for s in test.services if s.use is use), ()):
        unit = "" if argument.parameter.unit == SHARE or argument.value is None else argument.parameter.unit
        if argument.value or argument.problem:
            value = argument.value.text if argument.value else "?"
            origin = _origin(test, use, argument)
            yield {"name": argument.parameter.name, "value": value, "unit": unit, "origin": origin}


def _place(span: Span) -> str:
    return f"{shown_path(span.file)}:{span.line}"


def _origin(test: ResolvedTest, use: Use, argument: Argument) -> str:
    """Where a value is from: a place, the service or the rig that gives it, or the manifest."""
    entry, name = argument.entry, argument.parameter.name
    if argument.value is None:
        return "does not fit"
    if entry is None:
        is_default = argument.value == default_value(argument.parameter)
        return "default" if is_default else "what vehicle or application take"
    if name in use.parameters:
        return _place(entry.key)
    if entry.key.file == EMULATED_FILE:
        return EMULATED_FILE
    giver = next((u.name for u in test.spec.uses if argument.parameter.shared and name in u.parameters), "")
    return f"as {giver}, {_place(entry.key)}" if giver else f"rig {test.spec.rig}, {_place(entry.key)}"


def _lines(wiring: Wiring) -> Iterator[dict[str, Any]]:
    """Each message and memory with its producers and its consumers."""
    consumers = (*wiring.consumed, *wiring.application_consumes)
    produced: dict[Port, list[End]] = {}
    for end in (*wiring.produced, *wiring.application_produces):
        produced.setdefault(end.port, []).append(end)
    for port, ends in produced.items():
        anything = port.name == ANYTHING
        by = [c for c in consumers if c.port.consumes(port) and (not anything or _is_alone(wiring, c.port))]
        name = "any message of it" if anything else str(port)
        yield {"kind": port.kind, "port": name, "says": [_sender(e, wiring) for e in ends], "hears": _shown(by)}
    unsatisfied: dict[tuple[str, str], list[End]] = {}
    for end in consumers:
        if not any(end.port.consumes(port) for port in produced):
            unsatisfied.setdefault((end.port.kind, str(end.port)), []).append(end)
    for (kind, name), ends in unsatisfied.items():
        yield {"kind": kind, "port": name, "says": [], "hears": _shown(ends)}


def _topic(topic: Resolved) -> dict[str, Any]:
    written = topic.written
    return {
        "topic": written.topic.topic,
        "type": written.topic.type,
        "direction": "in" if written.given else "out",
        "node": topic.service,
        "bus": list(topic.bus),
    }


def _is_alone(wiring: Wiring, port: Port) -> bool:
    """Whether no service of the test produces by name what a port consumes."""
    return all(producer.port.name == ANYTHING for producer in wiring.producers(port))


def _sender(end: End, wiring: Wiring) -> str:
    """A producer, and whether it only prints the message."""
    is_printed = any((each.service, each.port) == (end.service, end.port) for each in wiring.printed)
    return f"{end.service} (application, prints it)" if is_printed else _shown([end])[0]


def _shown(ends: Iterable[End]) -> list[str]:
    names = (f"{end.service} (application)" if end.layer == "application" else end.service for end in ends)
    return list(dict.fromkeys(names))


def _asked(wiring: Wiring) -> Iterator[dict[str, Any]]:
    """What the application must produce, or may produce if it is not required; alternatives come last."""
    by_port: dict[tuple[str, str], list[End]] = {}
    for end in (*(e for e in wiring.required() if not e.instead), *wiring.alternatives):
        if end.port.can_be_required:
            by_port.setdefault((end.port.kind, str(end.port)), []).append(end)
    for (kind, name), ends in by_port.items():
        declared = (end.service for end in wiring.application_produces if ends[0].port.consumes(end.port))
        required = any(not end.port.optional for end in ends)
        services = {end.service for end in ends if end.instead}
        others = (e.port for e in wiring.consumed if e.service in services and e.is_asked and not e.instead)
        yield {
            "kind": kind,
            "port": name,
            "needed_by": [end.service for end in ends],
            "required": required,
            "instead_of": list(dict.fromkeys(map(str, others))),
            "declared_by": list(dict.fromkeys(declared)),
        }


def _file(instances: Sequence[Explanation]) -> str:
    """The first instance of a file whole, and the names of the others, which hold their values."""
    first, *others = instances
    names = [f"  {printable(one['name'])}\n" for one in others[:_MOST_ROWS]]
    rest = [f"  ... {len(others) - len(names)} more\n"] if len(others) > len(names) else []
    listed = [f"{len(others)} other instances\n" + "".join([*names, *rest])] if others else []
    return "\n".join([_head(first), *filter(None, [_services(first)]), _wiring(first), *listed])


def _head(one: Explanation) -> str:
    rig = (f", rig {one['rig']}" if one["rig"] else "") + (f" of any {one['pool']}" if one["pool"] else "")
    level = f"{LEVEL_WORDS[one['level']]}\n" if one["level"] in LEVEL_WORDS else ""
    title = f"{one['name']} ({one['level']}, {one['kind']}{rig})"
    return f"{printable(title)}\n{printable(one['file'])}\n{level}clock: {printable(one['clock'])}\n"


def _services(one: Explanation) -> str:
    lines = []
    for service in one["services"]:
        lines += [f"{printable('{layer}: {name} ({uses})'.format(**service))}\n", _values(one, service["arguments"])]
    if one["variables"]:
        lines += ["application: its variables\n", _values(one, one["variables"])]
    if one["vary"]:
        rows = [[r["name"], r["nominal"], r["values"], _short(one, r["origin"])] for r in one["vary"]]
        lines += ["ranges: their nominal values, and what dodo search tries\n", _table(rows, "  ")]
    return "".join(lines)


def _values(one: Explanation, arguments: Sequence[dict[str, str]]) -> str:
    return _table([[a["name"], _value(a), _short(one, a["origin"])] for a in arguments], "  ")


def _value(argument: dict[str, str]) -> str:
    return f"{argument['value']} {argument['unit']}".strip()


def _short(one: Explanation, origin: str) -> str:
    return origin.replace(f"{one['file']}:", "line ")


def _wiring(one: Explanation) -> str:
    asked = {each["port"] for each in one["asked"]}
    rows = []
    for line in one["wiring"]:
        nobody = "the application" if line["port"] in asked else "no producer"
        unheard = "any reader" if line["kind"] == "memory" else "no consumer"
        rows.append([_port(line), ", ".join(line["says"]) or nobody, "->", ", ".join(line["hears"]) or unheard])
    parts = ["producers and consumers\n" + _table(rows, "  ")]
    for title, required in (("the application must provide", True), ("the application may provide", False)):
        wanted = [each for each in one["asked"] if each["required"] is required]
        rows = [[_port(each), _needed(each), _declared(each, one)] for each in wanted]
        parts += [f"{title}\n" + _table(rows, "  ")] if rows else []
    rows = [
        [
            each["topic"],
            each["type"],
            "<-" if each["direction"] == "in" else "->",
            ", ".join(each["bus"]) or "no source",
        ]
        for each in one["topics"]
    ]
    parts += ["ROS topics: /clock and these\n" + _table(rows, "  ")] if rows else []
    words = told_in_words(one["told"])
    return "\n".join([*parts, f"{words}\n"] if words else parts)


def _port(line: dict[str, Any]) -> str:
    return f"memory {line['port']}" if line["kind"] == "memory" else str(line["port"])


def _needed(asked: dict[str, Any]) -> str:
    instead = f", instead of {' and '.join(asked['instead_of'])}" if asked["instead_of"] else ""
    return f"to {', '.join(asked['needed_by'])}{instead}"


def _declared(asked: dict[str, Any], one: Explanation) -> str:
    if not one["has_application"]:
        return ""
    if asked["declared_by"]:
        return f"declared by {', '.join(asked['declared_by'])}"
    undeclared = ", ".join(one["undeclared"])
    return f"not declared; {undeclared} has no x-dodo and may provide it" if undeclared else "not declared"


def _table(rows: Sequence[Sequence[str]], indent: str) -> str:
    """Columns padded to their widest cell, at most 48 wide; the last is not padded."""
    widths = [min(48, max(map(len, column))) for column in zip(*rows, strict=True)]
    lines = ("  ".join(cell.ljust(w) for cell, w in zip(row, widths, strict=True)).rstrip() for row in rows)
    return "".join(f"{indent}{printable(line)}\n" for line in lines)
