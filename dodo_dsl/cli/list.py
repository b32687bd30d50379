"""dodo list: list the tests and services."""

import argparse
import os
import shlex
from pathlib import Path
from typing import TextIO

from dodo_dsl import package_data
from dodo_dsl.cli import selection
from dodo_dsl.cli.errors import Exit, UsageError
from dodo_dsl.compiler import Checked, load, without_unsatisfied
from dodo_dsl.diagnostics import did_you_mean, shown_path
from dodo_dsl.spec.manifest import Manifest, Parameter, in_words
from dodo_dsl.spec.model import LEVEL_WORDS
from dodo_dsl.terminal import json_text, printable

EXAMPLES = """examples:
  dodo list                 the tests of the deployment
  dodo list 'sil-*' 'sil-perception[light=1]'    some of them
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


def main(options: argparse.Namespace, stdout: TextIO, stderr: TextIO) -> int:
    if options.test and options.services is not None:
        raise UsageError("--services lists services: name tests without it")
    everything = selection.select(options.test, (), ()) if options.test else load([])
    if options.services:
        return _explain(everything, options.services, stdout)
    of_services = options.services is not None
    rows = _services(everything) if of_services else _tests(everything)
    if options.json:
        stdout.write(json_text(rows))
    else:
        columns = ("name", "layers", "description") if of_services else ("name", "level", "kind", "description")
        _table(rows, columns, stdout)
        if not of_services and not options.test:
            levels = {spec.level for spec in everything.specs}
            stderr.writelines(f"{level}: {words}\n" for level, words in LEVEL_WORDS.items() if level in levels)
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
        raise UsageError(f"there is no service '{name}'; {did_you_mean(name, checked.manifests)}")
    lines = [f"{manifest.name} ({', '.join(manifest.layers)}): {manifest.description}", "", "parameters:"]
    for parameter in manifest.parameters.values():
        default = "" if parameter.default in (None, []) else f", default {parameter.default}"
        facts = f"{parameter.type}{default}"
        if parameter.required:
            others = [*["another service of the test"] * bool(parameter.shared), *["the rig"] * bool(parameter.rig)]
            facts += f", required unless {' or '.join(others)} provides it" if others else ", required"
        unit = parameter.unit.replace("1", "")  # of a share, nothing is written
        notes = (_bounds(parameter), in_words(parameter.when) if parameter.when else "")
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
    if manifest.example is not None:
        words = shlex.join([*manifest.process, "--cid=128", *manifest.example])
        lines.append(f"standalone: {_found_by(manifest)}{words}")
    stdout.writelines(f"{printable(line)}\n" for line in lines)
    return Exit.OK


def _found_by(manifest: Manifest) -> str:
    """The variable by which Python finds a service that is run by hand; empty where it does without."""
    folders = [] if Path("services", "base").is_dir() else [package_data.root()]
    if not manifest.folder.is_relative_to(package_data.services()):
        folders.append(manifest.folder.resolve().parents[1])
    return f"PYTHONPATH={shlex.quote(os.pathsep.join(map(str, folders)))} " if folders else ""


def _bounds(parameter: Parameter) -> str:
    """What values it may have."""
    if parameter.choices:
        return f"one of {', '.join(parameter.choices)}"
    low, high = parameter.minimum, parameter.maximum
    if low is not None and high is not None:
        return f"{low:.10g} to {high:.10g}"
    return f"at least {low:.10g}" if low is not None else f"at most {high:.10g}" if high is not None else ""


def _table(rows: list[dict[str, str]], columns: tuple[str, ...], stdout: TextIO) -> None:
    """Columns padded to their widest cell, except the last, so that it can be piped on."""
    widths = [max((len(row[c]) for row in rows), default=0) for c in columns[:-1]]
    for row in rows:
        cells = [row[c].ljust(w) for c, w in zip(columns, widths, strict=False)]
        stdout.write(printable("  ".join([*cells, row[columns[-1]]])) + "\n")
