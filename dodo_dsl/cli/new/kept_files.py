"""Files that ``dodo new`` finds and keeps: what they lack, and what in them meets DoDo's pipeline."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from dodo_dsl import source
from dodo_dsl.cli.new.new_file import New
from dodo_dsl.diagnostics import shown_path
from dodo_dsl.terminal import printable

PIPELINE = ".gitlab-ci.yml"
IGNORED = ".gitignore"
_JOB = "compile"
_STAGE = "test"
_OWN = ("script", "trigger", "extends", "run")
"""What a job of its own has, and no change to a job of the template."""


@dataclass(frozen=True)
class KeptPipeline:
    """``warning`` is empty where no job has the name of DoDo's; ``stages`` where the stage of DoDo's jobs is there."""

    includes_dodo: bool = False
    warning: str = ""
    stages: tuple[str, ...] = ()

    def step(self, templates: Sequence[str]) -> str:
        """What the user has to do so that the pipeline includes these templates."""
        files = " and ".join(f".gitlab/dodo/{name}.gitlab-ci.yml" for name in templates)
        if not self.stages:
            return f"include {files} in {PIPELINE}"
        reason = f"'{_STAGE}' is not among its stages: {', '.join(self.stages)}"
        return f"include {files} in {PIPELINE}, with 'inputs: {{stage: {self.stages[0]}}}', as {reason}"


def pipeline(path: Path) -> KeptPipeline:
    """What a pipeline file that is kept says; one that cannot be read says nothing, as GitLab will refuse it."""
    node, _ = source.read(path)
    if not isinstance(node, source.Mapping):
        return KeptPipeline()
    return KeptPipeline(_includes_dodo(node), _warning(node, path), _stages(node))


def missing_lines(file: New) -> list[str]:
    """The lines of a new file that the one in its place lacks; slashes around a path make no difference."""
    there = {line.strip().strip("/") for line in file.path.read_text(encoding="utf-8", errors="replace").splitlines()}
    return [line for line in file.content.decode().splitlines() if line.strip("/") not in there]


def _includes_dodo(root: source.Mapping) -> bool:
    included = root.get("include")
    return included is not None and any(
        isinstance(node, source.Scalar) and "dodo" in node.text for node in source.walk(included)
    )


def _warning(root: source.Mapping, path: Path) -> str:
    entry = root.entries.get(_JOB)
    if entry is None or not isinstance(entry.value, source.Mapping) or not entry.value.entries.keys() & set(_OWN):
        return ""
    place = f"{shown_path(str(path))}:{entry.key.line}:{entry.key.column}"
    return f"{place}: GitLab merges this job '{_JOB}' with DoDo's job of the same name; give yours another name"


def _stages(root: source.Mapping) -> tuple[str, ...]:
    node = root.get("stages")
    if not isinstance(node, source.Sequence) or node.tag:
        return ()
    names = tuple(printable(item.text) for item in node.items if isinstance(item, source.Scalar))
    return () if _STAGE in names or len(names) < len(node.items) else names
