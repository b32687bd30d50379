"""``python -m tests.search.worker FILE KILLED_AT WORD...``: ``dodo search`` in a process, with scripted drives.

Each drive takes a moment, and writes its name into FILE when it begins. The process kills itself in drive number
KILLED_AT, 0 for none.
"""

import asyncio
import os
import signal
import sys
import time
from pathlib import Path

from dodo_dsl.cli import search_session
from dodo_dsl.cli.main import main
from dodo_dsl.plan.model import Plan
from tests.run import scripted
from tests.run.scripted import ScriptedBackend, ScriptedBackends
from tests.search.scripted_drives import stages

_DRIVE_S = 0.15


def work(file: Path, killed_at: int, *words: str) -> int:
    begun: list[str] = []

    def backend(plan: Plan, attempt: int) -> ScriptedBackend:
        begun.append(plan.slug)
        with file.open("a") as written:
            written.write(f"{plan.slug}\n")
        time.sleep(_DRIVE_S)
        if len(begun) == killed_at:
            os.kill(os.getpid(), signal.SIGKILL)
        return ScriptedBackend(plan, stages(plan))

    asyncio.run = scripted.run  # type: ignore[assignment]
    search_session.Processes = lambda *_: ScriptedBackends(backend)  # type: ignore[assignment,misc]
    return main(["search", *words], sys.stdout, sys.stderr)


if __name__ == "__main__":
    file, killed_at, *rest = sys.argv[1:]
    sys.exit(work(Path(file), int(killed_at), *rest))
