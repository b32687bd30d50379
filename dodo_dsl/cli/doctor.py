"""dodo doctor: check what this machine can run, what it lacks and what killed runs left behind."""

import argparse
import dataclasses
from typing import TextIO

from dodo_dsl.cli.errors import Exit
from dodo_dsl.run import capabilities
from dodo_dsl.run.work_folder import reap_folders
from dodo_dsl.terminal import json_text, printable

EXAMPLES = """examples:
  dodo doctor              every finding, and what to do about it
  dodo doctor --clean      remove what killed runs left behind: processes, shared memory, containers, networks, volumes
  dodo doctor --json       the same as JSON
"""
_SIGNS = {"ok": "ok     ", "warning": "warning", "problem": "PROBLEM"}


def add(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--clean", action="store_true", help="remove what killed runs left behind")
    parser.add_argument("--json", action="store_true", help="output as JSON")


def main(options: argparse.Namespace, stdout: TextIO, stderr: TextIO) -> int:
    if options.clean:
        reap_folders()
        removed, left = capabilities.clean()
        stderr.writelines(f"removed: {printable(line)}\n" for line in removed)
        stderr.writelines(f"cannot be removed: {printable(line)}\n" for line in left)
    findings = [*capabilities.examine()]
    if options.json:
        stdout.write(json_text([dataclasses.asdict(f) for f in findings]))
    else:
        width = max(len(f.name) for f in findings)
        for finding in findings:
            stdout.write(f"{_SIGNS[finding.state]}  {finding.name:<{width}}  {finding.text}\n")
            if finding.advice:
                stdout.write(f"{'':7}  {'':<{width}}  -> {finding.advice}\n")
    return Exit.PROBLEMS if any(f.state == "problem" for f in findings) else Exit.OK
