"""What copies folders for an application counts before."""

import subprocess
from pathlib import Path

import pytest

from dodo_dsl.emit.compose import copy_command
from dodo_dsl.plan.model import Application
from dodo_dsl.spec.sandbox_limits import SandboxLimits

LIMITS = SandboxLimits(copies=1_000_000, copied_files=11)


@pytest.mark.parametrize(
    ("folders", "said"),
    [({"a": {"file": 600}}, ""), ({"a": {"file": 600}, "b": {"file": 600}}, "copies"),
     ({"many": {str(n): 0 for n in range(11)}}, ""), ({"many": {str(n): 0 for n in range(12)}}, "copied-files")],
)  # fmt: skip
def test_what_copies_counts_first(folders: dict[str, dict[str, int]], said: str, tmp_path: Path) -> None:
    """The program of a compiled test, as its shell gets it from compose, in other folders; sizes are in kB."""
    copies = {f"files-{number}": f"../../{name}" for number, name in enumerate(folders)}
    script = copy_command(Application("../..", (), copies=copies, limits=LIMITS)).replace("$$", "$")
    for name, files in zip(copies, folders.values(), strict=True):
        for place in (tmp_path / "from" / name, tmp_path / "to" / name):
            place.mkdir(parents=True)
        for file, size in files.items():
            (tmp_path / "from" / name / file).write_text("x" * size * 1000)
        (tmp_path / "from" / name / "large").symlink_to("/usr") if len(files) == 1 else None
    for old, new in (("/from", "from"), ("/to/", "to/"), ("/run/copied", "copied"), ("sleep infinity", "true")):
        script = script.replace(old, new)
    ran = subprocess.run(["sh", "-c", script], capture_output=True, text=True, check=False, cwd=tmp_path)
    assert (ran.returncode, ran.stderr) == (1 if said else 0, "")
    assert (tmp_path / "copied").exists() == (not said)
    assert ran.stdout.startswith(", ".join(f"'./{name}'" for name in folders)) == bool(said)
    assert f"'{said}' in 'sandbox'" in ran.stdout or not said
