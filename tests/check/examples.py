"""The examples of the rule catalogue as files: each with what it leaves out, from a valid test."""

import re
from pathlib import Path

from dodo_dsl import compiler
from dodo_dsl.diagnostics import Diagnostic
from dodo_dsl.emit.render import File, render_plan

SPEC = """\
dodo: 1
name: example
description: Drive to the finish line.
level: sil
kind: closed-loop
timeout: 60 s
environment:
  camera: {uses: virtual-camera, with: {map-path: ../maps/plain}}
action:
  vehicle: {uses: dynamic-model}
  pose: {uses: integrator}
evaluation:
  track: {uses: collision, with: {goal: finish}}
"""
BASE = SPEC.replace("name: example", "name: base").replace("environment:", "record: {frames: 1 Hz}\nenvironment:")
DEPLOYMENT = """\
dodo: 1
registry: [tests]
application: docker-compose.yml
"""
FILES = {
    "tests/example/example.dodo.yml": SPEC,
    "tests/base/base.dodo.yml": BASE,
    "tests/maps/plain/map.json": '{"model": [], "obstacles": [{"name": "finish", "lines": [[-1, 3, 1, 3]]}]}\n',
    "dodo.yml": DEPLOYMENT,
    "docker-compose.yml": "services: {driver: {image: driver, command: --cid=111}}\n",
}
EXAMPLE = "tests/example/example.dodo.yml"
MANIFEST = "my_services/judge/service.yml"
FILES[MANIFEST] = """\
name: judge
layers: [evaluation]
image: judge
process: [python, -m, my_services.judge]
description: Judges the steering.
"""
MERGED = (EXAMPLE, "dodo.yml", MANIFEST)
_HEADER = re.compile(r"^# (?P<path>[\w./-]+(\.\w+|/))\n", re.MULTILINE)


def files(example: str) -> dict[str, str]:
    """An example's files by path; the test and the deployment have the keys that the example leaves out."""
    first, *rest = _HEADER.split(example + "\n")
    written = {EXAMPLE: first, **dict(zip(rest[::3], rest[2::3], strict=True))}
    others = {path: text for path, text in FILES.items() if f"{path}/" not in written}
    return {**others, **{path: with_keys_of(path, text) if path in MERGED else text for path, text in written.items()}}


def with_keys_of(path: str, text: str) -> str:
    """The file with the example's top-level keys in place of its own."""
    return merged(FILES[path], text)


def merged(base: str, text: str) -> str:
    """A base with a text's top-level keys in place of its own."""
    if text.startswith("dodo: 1"):
        return text
    shown = {line.partition(":")[0] for line in text.splitlines() if line[:1].isalpha()}
    blocks = re.split(r"^(?=[a-z])", base, flags=re.MULTILINE)
    return "".join(b for b in blocks if b.partition(":")[0] not in shown) + text


def write(example: str, folder: Path, encoding: str = "utf-8") -> None:
    for path, text in files(example).items():
        target = folder / path
        target.parent.mkdir(parents=True, exist_ok=True)
        if path.endswith("/"):
            target.mkdir(parents=True)
        else:
            target.write_text(text, encoding=encoding)


def problems(folder: Path) -> list[Diagnostic]:
    """Every problem that ``dodo compile --check`` finds in the folder's tests, planning included."""
    return compiled(folder)[0]


def compiled(folder: Path) -> tuple[list[Diagnostic], list[File]]:
    """The problems of the folder's tests and the compiled files, which are not written."""
    checked = compiler.load([], start=folder)
    if not checked.ok:
        return list(checked.diagnostics), []
    made = compiler.plan(checked, folder / "generated")
    files = [file for plan in made.compiled.suite.plans for file in render_plan(plan)]
    return [*checked.diagnostics, *made.problems], [*files, made.pipeline]
