"""The key ``sandbox`` of ``dodo.yml``."""

from pathlib import Path

from dodo_dsl.spec.deployment import load_deployment
from dodo_dsl.spec.sandbox_limits import SandboxLimits


def deployed(folder: Path, text: str) -> tuple[SandboxLimits, list[str]]:
    path = folder / "dodo.yml"
    path.write_text(f"dodo: 1\n{text}")
    found, problems = load_deployment(path)
    return found.sandbox, [f"{p.span.line}: {p.message}" for p in problems]


def test_without_it_the_defaults_hold(tmp_path: Path) -> None:
    assert deployed(tmp_path, "") == (SandboxLimits(), [])


def test_all_that_can_be_said(tmp_path: Path) -> None:
    text = "sandbox: {memory: 4 GB, processes: 20, files: 100, file-size: 1.5 MB, cpus: 2.5, read: [~/models, /srv], "
    text += "copies: 5 GB, copied-files: 9}\n"
    limits = SandboxLimits(4 * 10**9, 20, 100, 1_500_000, ("~/models", "/srv"), 2.5, 5 * 10**9, 9)
    assert deployed(tmp_path, text) == (limits, [])
