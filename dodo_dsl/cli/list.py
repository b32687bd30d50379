"""dodo list: list the tests and services."""

import argparse
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path
from typing import TextIO

from dodo_dsl.cli import selection
from dodo_dsl.cli.errors import Exit, UsageError
from dodo_dsl.compiler import Checked, load, without_unsatisfied
from dodo_dsl.diagnostics import did_you_mean, shown_path
from dodo_dsl.spec.manifest import in_words
from dodo_dsl.spec.model import LEVELS, Spec
from dodo_dsl.terminal import json_text, printable

EXAMPLES = """examples:
  dodo list                 the tests of the deployment
  dodo list 'sil-*' 'sil-perception[light=1]'    some of them
  dodo list -v              each instance of a matrix
  dodo list --services      the services that a test may use
  dodo list --services integrator    one service: parameters, messages
  dodo list --json          the same as JSON
"""

_MOST_FILES = 3


def add(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("test", nargs="*", metavar="TEST", help="names, patterns, specs or folders (default: all)")
    parser.add_argument(
        "--services", nargs="?", const="", metavar="NAME", help="list services instead of tests, or describe one"
    )
    parser.add_argument("--json", action="store_true", help="output as JSON")
    parser.add_argument("-v", "--verbose", action="store_true", help="list each instance of a matrix")


def main(options: argparse.Namespace, stdout: TextIO, stderr: TextIO) -> int:
    if options.test and options.services is not None:
        raise UsageError("--services lists services: name tests without it")
    of_services = options.services is not None
    everything = selection.select(options.test, (), ()) if options.test else load([], services_only=of_services)
    if options.services:
        return _explain(everything, options.services, stdout)
    if options.json:
        stdout.write(json_text(_services(everything) if of_services else _tests(everything)))
    elif of_services:
        _table([tuple(row.values()) for row in _services(everything)], stdout)
    else:
        _table(_rows(everything.specs, options.verbose), stdout)
    checked = everything if options.test else without_unsatisfied(everything)
    stderr.write(selection.left_out(checked))
    if checked.ok:
        return Exit.OK
    stderr.write(f"problems in {_places(checked)}; dodo compile --check shows them\n")
    return Exit.USAGE


def _places(checked: Checked) -> str:
    """The files with errors, a few by name."""
    files = sorted({shown_path(d.span.file) for d in checked.diagnostics if d.severity == "error"})
    more = f" and {len(files) - _MOST_FILES} more files" if len(files) > _MOST_FILES else ""
    return printable(", ".join(files[:_MOST_FILES]) + more)


def _tests(checked: Checked) -> list[dict[str, str]]:
    return [
        {
            "name": spec.title,
            "level": spec.level or "?",
            "kind": spec.kind or "?",
            "description": spec.description or "",
            "slug": spec.slug,
            "file": shown_path(str(spec.path)),
        }
        for spec in checked.specs
    ]


def _services(checked: Checked) -> list[dict[str, str]]:
    return [
        {"name": m.name, "layers": ", ".join(m.layers), "description": m.description}
        for m in sorted(checked.manifests.values(), key=lambda m: m.name)
    ]


def _explain(checked: Checked, name: str, stdout: TextIO) -> int:
    manifest = checked.manifests.get(name)
    if manifest is None:
        raise UsageError(f"unknown service '{name}'; {did_you_mean(name, checked.manifests)}")
    lines = [f"{manifest.name} ({', '.join(manifest.layers)}): {manifest.description}", "", "parameters:"]
    for parameter in manifest.parameters.values():
        default = "" if parameter.default in (None, []) else f", default {parameter.default}"
        facts = f"{parameter.type}{default}"
        if parameter.required:
            others = [*["another service of the test"] * bool(parameter.shared), *["the rig"] * bool(parameter.rig)]
            facts += f", required unless {' or '.join(others)} provides it" if others else ", required"
        unit = parameter.unit.replace("1", "")  # of a share, nothing is written
        choices = f"one of {', '.join(parameter.choices)}" if parameter.choices else ""
        notes = (choices or parameter.bounds, in_words(parameter.when) if parameter.when else "")
        bounds = "".join(f"; {text}" for text in notes if text)
        lines += [f"  {parameter.name}: {facts} {unit}".rstrip() + bounds, f"      {parameter.help}"]
    for title, ports in (("messages", manifest.messages), ("shared memory", manifest.memory)):
        for direction, names in (("in", ports.inputs), ("out", ports.outputs)):
            if names:
                lines.append(f"{title} {direction}: {', '.join(names)}")
    for case in manifest.cases:
        for direction, names in (("in", case.ports.inputs), ("out", case.ports.outputs)):
            if names:
                lines.append(f"messages {direction} {in_words(case.when)}: {', '.join(names)}")
    if manifest.checks:
        checks = (f"{check} ({unit})" if unit else check for check, unit in manifest.checks.items())
        lines.append(f"checks: {', '.join(checks)}")
    stdout.writelines(f"{printable(line)}\n" for line in lines)
    return Exit.OK


def _rows(specs: Sequence[Spec], unfolded: bool) -> list[tuple[str, ...]]:
    """Level, name, kind and description of each test, by level; a matrix is one row unless ``unfolded``."""
    tests: dict[Path, list[Spec]] = defaultdict(list)
    for spec in specs:
        tests[spec.path].append(spec)
    rows: list[tuple[str, ...]] = []
    for spec, *others in tests.values():
        if others and not unfolded:
            dimensions = ", ".join(name for name, _ in (*spec.choice.values, *spec.choice.shown))
            about = f"{1 + len(others)} instances ({dimensions}): {spec.description or ''}"
            rows.append((spec.level or "?", spec.title.removesuffix(spec.choice.label), spec.kind or "?", about))
        else:
            rows += [(s.level or "?", s.title, s.kind or "?", s.description or "") for s in (spec, *others)]
    order = [*LEVELS, *(row[0] for row in rows)]
    return sorted(rows, key=lambda row: order.index(row[0]))


def _table(rows: Sequence[tuple[str, ...]], stdout: TextIO) -> None:
    """A line for each row, all columns but the last as wide as their widest cells."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)][:-1]
    for row in rows:
        cells = [cell.ljust(size) for cell, size in zip(row, widths, strict=False)]
        stdout.write(printable("  ".join([*cells, row[-1]])).rstrip() + "\n")
