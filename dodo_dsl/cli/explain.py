"""dodo explain: explain a rule, or how a test is wired and what its application must provide."""

import argparse
from collections.abc import Sequence
from dataclasses import asdict
from typing import TextIO

from dodo_dsl.check import catalogue
from dodo_dsl.check.explanation import ArgumentExplained, Asked, Explanation, Line, explain
from dodo_dsl.check.senders import told_in_words
from dodo_dsl.cli import selection
from dodo_dsl.cli.display import write_diagnostics
from dodo_dsl.cli.errors import Exit, UsageError
from dodo_dsl.diagnostics import did_you_mean
from dodo_dsl.spec.model import LEVEL_WORDS
from dodo_dsl.terminal import json_text, printable

EXAMPLES = """examples:
  dodo explain                       all rules, one line each
  dodo explain wrong-unit            a rule: its reason, what breaks it and what complies
  dodo explain sil-closed-straight   a test: services, origins of values, producers and consumers
  dodo explain 'sil-*' --json        several tests, as JSON
"""

_MOST_ROWS = 100


def add(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("word", nargs="?", metavar="TEST|RULE", help="a rule, or the name or path of a test")
    parser.add_argument("--json", action="store_true", help="output as JSON")
    selection.add_application(parser)


def main(options: argparse.Namespace, stdout: TextIO, stderr: TextIO) -> int:
    rules = catalogue.pages()
    if options.word is None:
        return _rules(options.json, stdout)
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
    stdout.write(json_text([asdict(e) for e in found]) if options.json else _text(found))
    stderr.write(selection.left_out(checked))
    write_diagnostics(stderr, checked.diagnostics)
    return Exit.OK if checked.ok else Exit.USAGE


def _rules(as_json: bool, stdout: TextIO) -> int:
    pages = catalogue.pages().values()
    if as_json:
        stdout.write(json_text([asdict(page) for page in pages]))
    else:
        stdout.write(_table([[page.name, page.summary] for page in pages], ""))
    return Exit.OK


def _text(found: Sequence[Explanation]) -> str:
    """The instances of a file together: the first one whole, and what differs in the others."""
    files: dict[str, list[Explanation]] = {}
    for one in found:
        files.setdefault(one.file, []).append(one)
    return "\n".join(_file(instances) for instances in files.values())


def _file(instances: Sequence[Explanation]) -> str:
    first = instances[0]
    parts = [_head(first), _services(first), _wiring(first), _differences(instances)]
    others = {(e.wiring, e.asked): e for e in reversed(instances) if (e.wiring, e.asked) != (first.wiring, first.asked)}
    parts += [f"{printable(other.name)}\n\n{_wiring(other)}" for other in reversed(others.values())]
    return "\n".join(part for part in parts if part)


def _head(one: Explanation) -> str:
    rig = f", rig {one.rig}" if one.rig else ""
    rig += f" of any {one.pool}" if one.pool else ""
    level = f"{LEVEL_WORDS[one.level]}\n" if one.level in LEVEL_WORDS else ""
    return f"{printable(f'{one.name} ({one.level}, {one.kind}{rig})')}\n{printable(one.file)}\n{level}"


def _services(one: Explanation) -> str:
    lines = []
    for service in one.services:
        lines.append(printable(f"{service.layer}: {service.name} ({service.uses})") + "\n")
        lines.append(_arguments(service.arguments, one))
    if one.variables:
        lines += ["application: its variables\n", _arguments(one.variables, one)]
    if one.vary:
        rows = [[r.name, r.nominal, r.values, r.origin.replace(f"{one.file}:", "line ")] for r in one.vary]
        lines += ["ranges: their nominal values, and what dodo search tries\n", _table(rows, "  ")]
    return "".join(lines)


def _arguments(arguments: Sequence[ArgumentExplained], one: Explanation) -> str:
    rows = [[a.name, f"{a.value} {a.unit}".strip(), a.origin.replace(f"{one.file}:", "line ")] for a in arguments]
    return _table(rows, "  ")


def _wiring(one: Explanation) -> str:
    rows = [[_port(line), _producers(line, one), "->", _consumers(line)] for line in one.wiring]
    parts = ["producers and consumers\n" + _table(rows, "  ")]
    for title, required in (("the application must provide", True), ("the application may provide", False)):
        asked = [a for a in one.asked if a.required is required]
        if asked:
            parts.append(
                f"{title}\n"
                + _table([[_port(a), f"to {', '.join(a.needed_by)}", _declared(a, one)] for a in asked], "  ")
            )
    if words := told_in_words(one.told):
        parts.append(f"{words}\n")
    return "\n".join(parts)


def _port(line: Line | Asked) -> str:
    return f"memory {line.port}" if line.kind == "memory" else line.port


def _consumers(line: Line) -> str:
    return ", ".join(line.hears) or ("any reader" if line.kind == "memory" else "no consumer")


def _producers(line: Line, one: Explanation) -> str:
    is_asked = any(line.port == a.port for a in one.asked)
    return ", ".join(line.says) or ("the application" if is_asked else "no producer")


def _declared(asked: Asked, one: Explanation) -> str:
    if not one.has_application:
        return ""
    if asked.declared_by:
        return f"declared by {', '.join(asked.declared_by)}"
    undeclared = ", ".join(one.undeclared)
    return f"not declared; {undeclared} has no x-dodo and may provide it" if undeclared else "not declared"


def _differences(instances: Sequence[Explanation]) -> str:
    """The values that differ between the instances, one row per instance."""
    if len(instances) == 1:
        return ""
    values = [_values(one) for one in instances]
    keys = [key for key in values[0] if len({v.get(key, "") for v in values}) > 1]
    rows = [[one.name, *(f"{k}: {v.get(k, '')}" for k in keys)] for one, v in zip(instances, values, strict=True)]
    rest = f"  ... {len(rows) - _MOST_ROWS} more\n" if len(rows) > _MOST_ROWS else ""
    return f"the {len(rows)} instances and their differences\n" + _table(rows[:_MOST_ROWS], "  ") + rest


def _values(one: Explanation) -> dict[str, str]:
    top = {"level": one.level, "kind": one.kind, "rig": one.rig}
    variables = {a.name: a.value for a in one.variables}
    services = {f"{s.name}.{a.name}": f"{a.value} {a.unit}".strip() for s in one.services for a in s.arguments}
    return top | services | variables


def _table(rows: Sequence[Sequence[str]], indent: str) -> str:
    """Columns padded to their widest cell, at most 48 wide; the last is not padded."""
    widths = [min(48, max(map(len, column))) for column in zip(*rows, strict=True)]
    lines = ("  ".join(cell.ljust(w) for cell, w in zip(row, widths, strict=True)).rstrip() for row in rows)
    return "".join(f"{indent}{printable(line)}\n" for line in lines)
