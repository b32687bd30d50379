"""Whether an application can be confined on this machine, and if not, whether the machine lacks what that takes."""

import os
import shutil
import subprocess
import tempfile

from dodo_dsl.run.process import namespaces
from dodo_dsl.run.process.confined import users
from dodo_dsl.run.process.confined.bubblewrap import PROGRAM
from dodo_dsl.run.process.confined.confined_process import ConfinedProcess
from dodo_dsl.run.process.confined.confinement import INTERPRETER, Confinement
from dodo_dsl.run.process.confined.places import Places
from dodo_dsl.run.process.confined.seccomp_filter import NoSeccomp

BUBBLEWRAP, NAMESPACES = "bubblewrap", "namespaces"
_FOLDER = "/usr"


def problem() -> str:
    """What goes wrong when a program that does nothing is confined as an application is; empty when nothing does.

    To be called by a sandbox with own mounts.
    """
    with tempfile.TemporaryFile() as output:
        try:
            confined = Confinement(_FOLDER, "network", 0, INTERPRETER)
            true = ConfinedProcess(["true"], {"PATH": os.defpath}, output.fileno(), confined, Places(users.own(0)))
            code = true.wait()
        except (OSError, subprocess.SubprocessError, NoSeccomp) as error:
            return str(error)
        output.seek(0)
        told = output.read(1000).decode(errors="replace").strip()
    return "" if code == 0 else told or f"exit code {code}"


def missing() -> str:
    """What confining takes and this machine lacks, each tried by itself: BUBBLEWRAP, NAMESPACES, or empty."""
    if shutil.which(PROGRAM) is None:
        return BUBBLEWRAP
    return NAMESPACES if namespaces.refusal() else ""
