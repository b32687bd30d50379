"""A copy of a shipped test in the user's registry, where it can be changed and extended."""

import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import yaml

from dodo_dsl.cli.errors import UsageError
from dodo_dsl.cli.new.new_file import New
from dodo_dsl.cli.new.scaffold import spec_files
from dodo_dsl.plan.test_files import copies
from dodo_dsl.source import Mapping as Written
from dodo_dsl.source import plain, read
from dodo_dsl.spec import extends
from dodo_dsl.spec.instances import vary
from dodo_dsl.spec.manifest import Manifest
from dodo_dsl.spec.model import LAYERS, Spec
from dodo_dsl.spec.values import ValueProblem, convert

_NAME = re.compile(r"^name: .*$", re.MULTILINE)
_EDITOR = re.compile(r"^# yaml-language-server:.*\n")


def copied_files(
    name: str, instances: Sequence[Spec], manifests: Mapping[str, Manifest], registry: Path, root: Path
) -> list[New]:
    """The test of ``instances`` as ``name`` in ``registry``, with the files that it needs and the registry lacks."""
    return [
        *spec_files(name, registry / name, root, _text(name, instances[0])),
        *_files(instances, manifests, registry),
    ]


def _text(name: str, base: Spec) -> bytes:
    """The spec's own text; one that extends others is resolved first, as the copy leaves them behind."""
    node, _ = read(base.path)
    text = base.path.read_text(encoding="utf-8")
    if isinstance(node, Written) and extends.KEY not in node.entries and len(_NAME.findall(text)) == 1:
        return _NAME.sub(f"name: {name}", _EDITOR.sub("", text)).encode()
    resolved = extends.resolve(node, base.path, base.location.root)[0] if node else None
    if not isinstance(resolved, Written):
        raise UsageError(f"'{base.name}' cannot be read, so it cannot be copied")
    written = plain(resolved)
    used = vary.PLACEHOLDERS.used(resolved)
    ranges = {key: one for key, one in written.pop(vary.KEY, {}).items() if key in used}
    written |= {vary.KEY: ranges} if ranges else {}
    rest = {key: value for key, value in written.items() if key not in ("dodo", "name", *LAYERS)}
    keys = {"dodo": 1, "name": name, **rest, **{key: written[key] for key in LAYERS if key in written}}
    text = yaml.safe_dump(keys, sort_keys=False, default_flow_style=None, width=1000, allow_unicode=True)
    return str(text).encode()


def _files(instances: Sequence[Spec], manifests: Mapping[str, Manifest], registry: Path) -> Iterator[New]:
    """The files that the test names, each once; existing maps and recordings are kept."""
    for path in dict.fromkeys(path for spec in instances for path in _paths(spec, manifests)):
        root = instances[0].location.root.resolve()
        if (registry / path.relative_to(root)).exists():
            continue
        yield from (New(registry / copy.target, copy.source.read_bytes()) for copy in copies(path, root))


def _paths(spec: Spec, manifests: Mapping[str, Manifest]) -> Iterator[Path]:
    for use in spec.uses:
        parameters = manifests[use.uses.text].parameters if use.uses.text in manifests else {}
        for key, entry in use.parameters.items():
            if key not in parameters or parameters[key].type != "path":
                continue
            try:
                value = convert(parameters[key], entry.value, spec.location.root)
            except ValueProblem as problem:
                raise UsageError(problem.diagnostic.message) from problem
            if value.path is not None:
                yield value.path
