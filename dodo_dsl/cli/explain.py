"""dodo explain: explain a rule, or how a test is wired and what its application must provide."""

import argparse
from collections.abc import Iterable, Iterator, Sequence
from itertools import groupby
from typing import TextIO

from dodo_dsl.check import catalogue
from dodo_dsl.check.resolve import ResolvedTest
from dodo_dsl.check.senders import told, told_in_words
from dodo_dsl.check.wiring import ANYTHING, End, Port, Wiring
from dodo_dsl.cli import selection
from dodo_dsl.cli.display import write_diagnostics
from dodo_dsl.cli.errors import Exit, UsageError
from dodo_dsl.diagnostics import Span, did_you_mean, shown_path
from dodo_dsl.spec.arguments import Argument, default_value
from dodo_dsl.spec.model import LEVEL_WORDS, Use
from dodo_dsl.spec.quantity import SHARE
from dodo_dsl.spec.rig import EMULATED_FILE
from dodo_dsl.terminal import printable

EXAMPLES = """examples:
  dodo explain                       all rules, one line each
  dodo explain wrong-unit            a rule: its reason, what breaks it and what complies
  dodo explain sil-closed-straight   a test: services, origins of values, producers and consumers
"""

_MOST_ROWS = 100


def add(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("word", nargs="?", metavar="TEST|RULE", help="a rule, or the name or path of a test")
    selection.add_application(parser)


def main(options: argparse.Namespace, stdout: TextIO, stderr: TextIO) -> int:
    rules = catalogue.pages()
    if options.word is None:
        stdout.write(_table([[page.name, page.summary] for page in rules.values()], ""))
        return Exit.OK
    if options.word in rules:
        stdout.write(catalogue.text(rules[options.word]))
        return Exit.OK
    try:
        checked = selection.select([options.word], (), options.application)
    except selection.NoSuchTest as error:
        near = did_you_mean(options.word, rules) if "-" in options.word else ""
        said = str(error).replace("unknown test", "unknown test or rule", 1)
        raise UsageError(f"{said}; " + (f"or the rule: {near}" if near else "'dodo explain' lists the rules")) from None
    files = groupby(checked.tests, lambda test: test.spec.path)
    stdout.write("\n".join(_file(list(instances)) for _, instances in files))
    stderr.write(selection.left_out(checked))
    write_diagnostics(stderr, checked.diagnostics)
    return Exit.OK if checked.ok else Exit.USAGE


def _file(instances: Sequence[ResolvedTest]) -> str:
    """The instances of a file together: the first one whole, and what differs in the others."""
    first, wired = instances[0], dict[str, ResolvedTest]()
    for test in instances:
        wired.setdefault(_wiring(test.wiring), test)
    own, *others = wired
    parts = [_head(first), _services(first), own, _differences(instances)]
    parts += [f"{printable(wired[other].spec.title)}\n\n{other}" for other in others]
    return "\n".join(part for part in parts if part)


def _head(test: ResolvedTest) -> str:
    spec = test.spec
    rig = (f", rig {spec.rig}" if spec.rig else "") + (f" of any {spec.pool}" if spec.pool else "")
    level = f"{LEVEL_WORDS[spec.level]}\n" if spec.level in LEVEL_WORDS else ""
    title = f"{spec.title} ({spec.level or '?'}, {spec.kind or '?'}{rig})"
    return f"{printable(title)}\n{printable(shown_path(str(spec.path)))}\n{level}"


def _services(test: ResolvedTest) -> str:
    lines = []
    for use in test.spec.uses:
        lines.append(printable(f"{use.layer}: {use.name} ({use.uses.text})") + "\n")
        rows = [[a.parameter.name, _value(a), _origin(test, use, a)] for a in _arguments(test, use)]
        lines.append(_table(rows, "  "))
    if given := test.spec.variables:
        rows = [[name, test.variables.get(name, "?"), _place(test, entry.key)] for name, entry in given.items()]
        lines += ["application: its variables\n", _table(rows, "  ")]
    if ranges := test.spec.ranges:
        rows = [[r.name, r.nominal.text, r.text, _place(test, r.nominal.span)] for r in ranges]
        lines += ["ranges: their nominal values, and what dodo search tries\n", _table(rows, "  ")]
    return "".join(lines)


def _arguments(test: ResolvedTest, use: Use) -> list[Argument]:
    given = (each.arguments.values() for each in test.services if each.use is use)
    return [argument for arguments in given for argument in arguments if argument.value or argument.problem]


def _value(argument: Argument) -> str:
    unit = "" if argument.parameter.unit == SHARE else argument.parameter.unit
    return f"{argument.value.text} {unit}".strip() if argument.value else "?"


def _place(test: ResolvedTest, span: Span) -> str:
    return f"line {span.line}" if span.file == str(test.spec.path) else f"{shown_path(span.file)}:{span.line}"


def _origin(test: ResolvedTest, use: Use, argument: Argument) -> str:
    """Where a value is from: a place, the service or the rig that gives it, or the manifest."""
    entry, name = argument.entry, argument.parameter.name
    if argument.value is None:
        return "does not fit"
    if entry is None:
        is_default = argument.value == default_value(argument.parameter)
        return "default" if is_default else "what vehicle or application take"
    if name not in use.parameters and entry.key.file == EMULATED_FILE:
        return EMULATED_FILE
    place = _place(test, entry.key)
    givers = (u.name for u in test.spec.uses if argument.parameter.shared and name in u.parameters)
    return place if name in use.parameters else f"as {next(givers, f'rig {test.spec.rig}')}, {place}"


def _wiring(wiring: Wiring) -> str:
    asked: dict[str, list[End]] = {}
    for end in wiring.required():
        if end.port.can_be_required:
            asked.setdefault(_named(end.port), []).append(end)
    parts = ["producers and consumers\n" + _table(list(_lines(wiring, asked)), "  ")]
    for title, required in (("the application must provide", True), ("the application may provide", False)):
        wanted = [(name, ends) for name, ends in asked.items() if required is any(not e.port.optional for e in ends)]
        rows = [[n, f"to {', '.join(e.service for e in ends)}", _declared(ends[0].port, wiring)] for n, ends in wanted]
        parts += [f"{title}\n" + _table(rows, "  ")] if rows else []
    words = told_in_words(tuple(dict.fromkeys(str(end.port) for end in told(wiring))))
    return "\n".join([*parts, f"{words}\n"] if words else parts)


def _named(port: Port) -> str:
    return f"memory {port}" if port.kind == "memory" else "any message of it" if port.name == ANYTHING else str(port)


def _lines(wiring: Wiring, asked: Iterable[str]) -> Iterator[list[str]]:
    """A row for each message and memory: its name, its producers and its consumers."""
    consumers = (*wiring.consumed, *wiring.application_consumes)
    produced: dict[Port, list[End]] = {}
    for end in (*wiring.produced, *wiring.application_produces):
        produced.setdefault(end.port, []).append(end)
    for port, ends in produced.items():
        by = [c for c in consumers if c.port.consumes(port) and (port.name != ANYTHING or _is_alone(wiring, c.port))]
        none = "any reader" if port.kind == "memory" else "no consumer"
        yield [_named(port), ", ".join(_sender(end, wiring) for end in ends), "->", _shown(by) or none]
    unsatisfied: dict[str, list[End]] = {}
    for end in consumers:
        if not any(end.port.consumes(port) for port in produced):
            unsatisfied.setdefault(_named(end.port), []).append(end)
    for name, ends in unsatisfied.items():
        yield [name, "the application" if name in asked else "no producer", "->", _shown(ends)]


def _is_alone(wiring: Wiring, port: Port) -> bool:
    """Whether no service of the test produces by name what a port consumes."""
    return all(producer.port.name == ANYTHING for producer in wiring.producers(port))


def _sender(end: End, wiring: Wiring) -> str:
    is_printed = any((each.service, each.port) == (end.service, end.port) for each in wiring.printed)
    return f"{end.service} (application, prints it)" if is_printed else _shown([end])


def _shown(ends: Iterable[End]) -> str:
    names = (f"{end.service} (application)" if end.layer == "application" else end.service for end in ends)
    return ", ".join(dict.fromkeys(names))


def _declared(port: Port, wiring: Wiring) -> str:
    if not wiring.has_application:
        return ""
    declared = dict.fromkeys(end.service for end in wiring.application_produces if port.consumes(end.port))
    if declared:
        return f"declared by {', '.join(declared)}"
    undeclared = ", ".join(wiring.undeclared)
    return f"not declared; {undeclared} has no x-dodo and may provide it" if undeclared else "not declared"


def _differences(instances: Sequence[ResolvedTest]) -> str:
    """The values that differ between the instances, one row per instance."""
    if len(instances) == 1:
        return ""
    values = [_values(test) for test in instances]
    keys = [key for key in values[0] if len({v.get(key, "") for v in values}) > 1]
    rows = [[t.spec.title, *(f"{k}: {v.get(k, '')}" for k in keys)] for t, v in zip(instances, values, strict=True)]
    rest = f"  ... {len(rows) - _MOST_ROWS} more\n" if len(rows) > _MOST_ROWS else ""
    return f"the {len(rows)} instances and their differences\n" + _table(rows[:_MOST_ROWS], "  ") + rest


def _values(test: ResolvedTest) -> dict[str, str]:
    spec = test.spec
    services = {f"{u.name}.{a.parameter.name}": _value(a) for u in spec.uses for a in _arguments(test, u)}
    return {"level": spec.level or "", "kind": spec.kind or "", "rig": spec.rig or "", **services, **test.variables}


def _table(rows: Sequence[Sequence[str]], indent: str) -> str:
    """Columns padded to their widest cell, at most 48 wide; the last is not padded."""
    widths = [min(48, max(map(len, column))) for column in zip(*rows, strict=True)]
    lines = ("  ".join(cell.ljust(w) for cell, w in zip(row, widths, strict=True)).rstrip() for row in rows)
    return "".join(f"{indent}{printable(line)}\n" for line in lines)
