"""dodo explain: explain a rule, or how a test is wired and what its application must provide."""

import argparse
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict
from itertools import groupby
from operator import itemgetter
from typing import Any, TextIO

from dodo_dsl.check import catalogue
from dodo_dsl.check.resolve import ResolvedTest
from dodo_dsl.check.ros_topics import Resolved
from dodo_dsl.check.senders import told, told_in_words
from dodo_dsl.check.wiring import ANYTHING, End, Port, Wiring
from dodo_dsl.cli import selection
from dodo_dsl.cli.display import write_diagnostics
from dodo_dsl.cli.errors import Exit, UsageError
from dodo_dsl.diagnostics import did_you_mean, shown_path
from dodo_dsl.spec.arguments import Argument
from dodo_dsl.spec.quantity import SHARE
from dodo_dsl.terminal import json_text, printable

EXAMPLES = """examples:
  dodo explain                       all rules, one line each
  dodo explain wrong-unit            a rule: its reason, what breaks it and what complies
  dodo explain sil-closed-straight   a test: values of services, producers and consumers
  dodo explain 'sil-*' --json        several tests, as JSON
"""

Explanation = dict[str, Any]
"""What ``dodo explain --json`` has of a test, with its keys; ``told`` is what it gets of what only a simulation has."""


def add(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("word", nargs="?", metavar="TEST|RULE", help="a rule, or the name or path of a test")
    parser.add_argument("--json", action="store_true", help="output as JSON")
    selection.add_application(parser)


def main(options: argparse.Namespace, stdout: TextIO, stderr: TextIO) -> int:
    rules = catalogue.pages()
    if options.word is None:
        width = max(map(len, rules))
        table = "".join(f"{page.name.ljust(width)}  {page.summary}\n" for page in rules.values())
        stdout.write(json_text(list(map(asdict, rules.values()))) if options.json else table)
        return Exit.OK
    if options.word in rules:
        page = rules[options.word]
        stdout.write(json_text(asdict(page)) if options.json else catalogue.text(page))
        return Exit.OK
    try:
        checked = selection.select([options.word], (), options.application)
    except selection.NoSuchTest as error:
        near = did_you_mean(options.word, rules) if "-" in options.word else ""
        said = str(error).replace("unknown test", "unknown test or rule", 1)
        raise UsageError(f"{said}; " + (f"or the rule: {near}" if near else "'dodo explain' lists the rules")) from None
    found = [explain(test) for test in checked.tests]
    files = groupby(found, itemgetter("file"))
    stdout.write(json_text(found) if options.json else "\n".join(_file(list(instances)) for _, instances in files))
    stderr.write(selection.left_out(checked))
    write_diagnostics(stderr, checked.diagnostics)
    return Exit.OK if checked.ok else Exit.USAGE


def explain(test: ResolvedTest) -> Explanation:
    spec, wiring = test.spec, test.wiring
    values = {service.use.name: _values(service.arguments.values()) for service in test.services}
    return {
        "name": spec.title,
        "slug": spec.slug,
        "file": shown_path(str(spec.path)),
        "level": spec.level or "?",
        "kind": spec.kind or "?",
        "clock": spec.clock,
        "rig": spec.rig or "",
        "pool": spec.pool,
        "services": [
            {"layer": use.layer, "name": use.name, "uses": use.uses.text, "values": values.get(use.name, {})}
            for use in spec.uses
        ],
        "variables": {name: test.variables.get(name, "?") for name in spec.variables},
        "vary": {one.name: f"{one.nominal.text}, dodo search: {one.text}" for one in spec.ranges},
        "wiring": list(_lines(wiring)),
        "asked": list(_asked(wiring)),
        "topics": [*map(_topic, wiring.topics)],
        "told": list(dict.fromkeys(str(end.port) for end in told(wiring))),
    }


def _values(arguments: Iterable[Argument]) -> dict[str, str]:
    units = {each.parameter.name: each.parameter.unit.replace(SHARE, "") for each in arguments}
    return {
        each.parameter.name: f"{each.value.text} {units[each.parameter.name]}".rstrip()
        for each in arguments
        if each.value
    }


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
    return all(producer.port.name == ANYTHING for producer in wiring.producers(port))


def _sender(end: End, wiring: Wiring) -> str:
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
    """The first instance of a file whole, and the number of the others, which have other values."""
    one, *others = instances
    about = [one["level"], one["kind"], f"clock {one['clock']}", *filter(None, (one["rig"], one["pool"]))]
    parts = [f"{printable(one['name'])} ({printable(', '.join(about))})\n{printable(one['file'])}\n"]
    titled = {"{layer}: {name} ({uses})".format(**each): each["values"] for each in one["services"]}
    for title, values in {**titled, "variables of the application": one["variables"], "ranges": one["vary"]}.items():
        parts += [f"{printable(title)}\n" + _table(list(values.items()))] if values else []
    parts.append("producers and consumers\n" + _table(_wiring(one)))
    for title, required in (("the application must provide", True), ("the application may provide", False)):
        rows = [_wanted(each) for each in one["asked"] if each["required"] is required]
        parts += [f"{title}\n" + _table(rows)] if rows else []
    arrows = {"in": "<-", "out": "->"}
    rows = [(t["topic"], t["type"], arrows[t["direction"]], ", ".join(t["bus"]) or "no source") for t in one["topics"]]
    parts += ["ROS topics: /clock and these\n" + _table(rows)] if rows else []
    parts += [f"{words}\n"] if (words := told_in_words(one["told"])) else []
    parts += [f"{len(others)} other instances (--json shows them)\n"] if others else []
    return "\n".join(parts)


def _wiring(one: Explanation) -> Iterator[Sequence[str]]:
    asked = {each["port"] for each in one["asked"]}
    for line in one["wiring"]:
        nobody = "the application" if line["port"] in asked else "no producer"
        unheard = "any reader" if line["kind"] == "memory" else "no consumer"
        yield _port(line), ", ".join(line["says"]) or nobody, "->", ", ".join(line["hears"]) or unheard


def _port(line: Explanation) -> str:
    return f"memory {line['port']}" if line["kind"] == "memory" else str(line["port"])


def _wanted(asked: Explanation) -> Sequence[str]:
    instead = f", instead of {' and '.join(asked['instead_of'])}" if asked["instead_of"] else ""
    declared = ", ".join(asked["declared_by"])
    needed = f"to {', '.join(asked['needed_by'])}{instead}"
    return _port(asked), needed, f"declared by {declared}" if declared else "not declared"


def _table(rows: Iterable[Sequence[str]]) -> str:
    """Columns padded to their widest cell, at most 48 wide; the last is not padded."""
    table = list(rows)
    widths = [min(48, max(map(len, column))) for column in zip(*table, strict=True)]
    lines = ("  ".join(cell.ljust(w) for cell, w in zip(row, widths, strict=True)).rstrip() for row in table)
    return "".join(f"  {printable(line)}\n" for line in lines)
