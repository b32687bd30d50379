"""A session of neovim, with the settings of docs/how-to/editors.md, which also shows what happens in it."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.lsp.conftest import SPEC, Repository
from tests.lsp.editor import PATIENCE_S, ROOT

NVIM = shutil.which("nvim")
SCRIPT = Path(__file__).with_name("session.lua")
PAGE = ROOT / "docs" / "how-to" / "editors.md"
WRONG = SPEC.replace("uses: integrator", "uses: integrater").replace("freq: 10 Hz", "freqq: 10 Hz")


def block(language: str, after: str) -> str:
    """The first code block of a language after a text of the page."""
    found = re.search(rf"```{language}\n(.*?)```", PAGE.read_text().partition(after)[2], re.DOTALL)
    assert found
    return found[1]


@pytest.mark.slow
@pytest.mark.skipif(NVIM is None, reason="neovim is not installed (scripts/install-test-tools)")
@pytest.mark.proof
def test_a_session_goes_as_the_docs_show(tmp_path: Path) -> None:
    repository = Repository(tmp_path.resolve() / "repository")
    repository.write()
    repository.spec.write_text(WRONG)
    (tmp_path / "init.lua").write_text(block("lua", "Older ones"))
    programs = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    homes = {f"XDG_{name}_HOME": str(tmp_path / name) for name in ("CONFIG", "DATA", "STATE")}
    transcript = tmp_path / "transcript"
    done = subprocess.run(
        [
            str(NVIM), "--headless", "--noplugin", "-n", "-i", "NONE", "-u", str(tmp_path / "init.lua"),
            str(repository.spec.relative_to(repository.folder)), "-c", f"luafile {SCRIPT}",
        ],
        cwd=repository.folder,
        env={**os.environ, **homes, "PATH": programs, "DODO_TRANSCRIPT": str(transcript)},
        check=False,
        capture_output=True,
        text=True,
        timeout=2 * PATIENCE_S,
    )  # fmt: skip
    written = transcript.read_text() if transcript.exists() else done.stdout + done.stderr
    assert (done.returncode, written.strip()) == (0, block("text", "### A session").strip())
    assert repository.spec.read_text() == SPEC
