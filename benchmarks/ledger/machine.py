"""What the machine and the checkout are, as far as a measurement depends on them."""

import os
import platform
import subprocess
from pathlib import Path

from benchmarks.ledger.ledger import Machine


def this_machine() -> Machine:
    lines = Path("/proc/cpuinfo").read_text().splitlines()
    processor = next((line.partition(":")[2].strip() for line in lines if line.startswith("model name")), "unknown")
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 1e9
    system = f"{platform.system()} {platform.release()}"
    return Machine(processor, len(os.sched_getaffinity(0)), round(memory, 1), system, platform.python_version())


def commit_of(checkout: Path) -> str:
    """The commit's short name, with a note where files differ from it; the folder's name outside git."""
    command = ["git", "-C", str(checkout), "describe", "--always", "--dirty=+", "--exclude=*"]
    found = subprocess.run(command, capture_output=True, text=True, check=False)
    return found.stdout.strip() or checkout.resolve().name
