"""What the application may use, and what it sees where it runs as processes.

Imports the standard library alone, as sandboxes load it and start often.
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class SandboxLimits:
    """``memory`` in bytes of a service with all its processes; ``file_size`` in bytes; ``files`` open in a process.

    ``processes`` counts threads, too. ``cpus`` are the processors of a container, None for all.
    ``copies`` is what the test's copies of the repository's folders may hold in bytes, in ``copied_files`` files.
    ``reads`` are paths beside the application's own folder that it may read.
    """

    memory: int = 2 * 10**9
    processes: int = 1024
    files: int = 1024
    file_size: int = 10**9
    reads: tuple[str, ...] = ()
    cpus: float | None = None
    copies: int = 2 * 10**9
    copied_files: int = 100_000
