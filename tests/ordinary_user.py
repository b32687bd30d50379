"""Who tests are where the ordinary user matters and root runs them."""

import os
import sys
from collections.abc import Sequence
from pathlib import Path

ROOT = Path(__file__).parents[1]
USER = 12_345
"""It has no account."""


def words_as_user(folder: Path, groups: Sequence[int] = ()) -> list[str]:
    """What runs a program as an ordinary user, who sees the interpreter and the sources even below ``/root``."""
    shown = [str(path) for path in dict.fromkeys((ROOT, Path(sys.prefix), Path(sys.base_prefix)))]
    below = [path for path in shown if path.startswith("/root/")]
    parents = sorted({str(p) for path in below for p in Path(path).parents if str(p).startswith("/root/")})
    mounts = ["--perms", "0755", "--tmpfs", "/root"] if below else []
    mounts += [word for path in parents for word in ("--perms", "0755", "--dir", path)]
    mounts += [word for path in below for word in ("--ro-bind", path, path)]
    os.chown(folder, USER, USER)
    joined = ["--groups", ",".join(map(str, groups))] if groups else ["--clear-groups"]
    user = ["setpriv", f"--reuid={USER}", f"--regid={USER}", *joined, "--bounding-set=-all", "--inh-caps=-all"]
    kept = ["--cap-add", "CAP_SETUID", "--cap-add", "CAP_SETGID", "--cap-add", "CAP_SETPCAP"]
    return ["bwrap", "--dev-bind", "/", "/", *mounts, *kept, "--", *user, "--"]
