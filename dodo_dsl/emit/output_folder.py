"""Generated files on disk: a folder a test, which is replaced as a whole, or compared with what there is."""

import difflib
import errno
import filecmp
import json
import shutil
import stat
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from dodo_dsl import atomic
from dodo_dsl.emit.render import PLAN_FILE, File, render_plan
from dodo_dsl.opendlv import regular_file
from dodo_dsl.plan.build import Compiled
from dodo_dsl.plan.model import Plan
from dodo_dsl.plan.test_files import SHARED, is_shared_name

FILES = "files"


@dataclass(frozen=True)
class _Link:
    text: str


_Entries = Mapping[str, str | Path | _Link]
"""What stands at each path of a folder: a text, the copy of a file, or a link."""


def _of_test(compiled: Compiled, plan: Plan, images: Sequence[str] = ()) -> _Entries:
    texts = {file.path.partition("/")[2]: file.text for file in render_plan(plan)}
    texts[".env"] += "".join(f"{line}\n" for line in images)
    copies = compiled.copies[plan.slug]
    return {**texts, **{f"{FILES}/{c.target}": _Link(c.link) if c.shared else c.source for c in copies}}


def _of_all(compiled: Compiled) -> _Entries:
    return {copy.shared: copy.source for copies in compiled.copies.values() for copy in copies if copy.shared}


def write(compiled: Compiled, pipeline: File, out: Path, images: Sequence[str] = ()) -> None:
    """Writes everything below ``out`` and removes tests of earlier compilations that are no longer there.

    Raises NotReplaceable where a test's folder would replace what is not DoDo's, before anything is written.
    """
    plans, shared = compiled.suite.plans, _of_all(compiled)
    for name in (*(plan.slug for plan in plans), SHARED):
        _refuse_foreign(out / name)
    if not _is_written(out / pipeline.path, pipeline.text):
        atomic.write_text(out / pipeline.path, pipeline.text)
    _replace(out / SHARED, shared)
    for plan in plans:
        _replace(out / plan.slug, _of_test(compiled, plan, images))
    for stale in stale_folders(compiled, out):
        shutil.rmtree(stale)


def _refuse_foreign(folder: Path) -> None:
    """No link is followed, and nothing of others is removed, which may lie in a folder of a test's name."""
    if folder.is_symlink():
        raise atomic.NotReplaceable(errno.ELOOP, "a symlink, which no output follows", str(folder))
    if folder.is_dir() and any(folder.iterdir()) and not _is_ours(folder):
        raise atomic.NotReplaceable(errno.EEXIST, "no compiled test; name another folder with --output", str(folder))


def _is_ours(folder: Path) -> bool:
    if folder.name == SHARED:
        return all(is_shared_name(path.name) for path in folder.iterdir())
    try:
        return bool(json.loads(regular_file.text(folder / PLAN_FILE)).get("dodo") == "plan")
    except (OSError, ValueError, AttributeError):
        return False


def _replace(folder: Path, wanted: _Entries) -> None:
    if not wanted:
        shutil.rmtree(folder, ignore_errors=True)
    elif _changed(folder, wanted):
        with atomic.new_folder(folder) as stage:
            for name, entry in wanted.items():
                (stage / name).parent.mkdir(parents=True, exist_ok=True)
                _put(stage / name, entry)
            _open_to_containers(stage / FILES if (stage / PLAN_FILE).exists() else stage)
            if folder.exists():
                shutil.rmtree(folder)


def _put(path: Path, entry: str | Path | _Link) -> None:
    if isinstance(entry, _Link):
        path.symlink_to(entry.text)
    elif isinstance(entry, Path):
        shutil.copyfile(entry, path)
    else:
        path.write_bytes(entry.encode())


def _is_written(path: Path, entry: str | Path | _Link) -> bool:
    if isinstance(entry, _Link):
        return path.is_symlink() and str(path.readlink()) == entry.text
    if path.is_symlink() or not path.is_file():
        return False
    return path.read_bytes() == entry.encode() if isinstance(entry, str) else filecmp.cmp(entry, path, shallow=False)


def _changed(folder: Path, wanted: _Entries) -> list[str]:
    """What differs from a folder, and what an earlier compilation put there and this one does not."""
    found = (path.relative_to(folder).as_posix() for path in sorted(folder.rglob("*")) if not path.is_dir())
    ours = (name for name in found if folder.name == SHARED or name.startswith(f"{FILES}/"))
    surplus = [name for name in ours if name not in wanted]
    return [*(name for name, entry in wanted.items() if not _is_written(folder / name, entry)), *surplus]


def _open_to_containers(folder: Path) -> None:
    """Everybody may read the files, for any umask, as users of containers must; the folder above may be closed."""
    for path in (folder, *folder.rglob("*")) if folder.is_dir() else ():
        if not path.is_symlink():
            path.chmod(stat.S_IMODE(path.stat().st_mode) | (0o555 if path.is_dir() else 0o444))


def stale_folders(compiled: Compiled, out: Path) -> list[Path]:
    slugs = {plan.slug for plan in compiled.suite.plans}
    folders = [path.parent for path in sorted(out.glob(f"*/{PLAN_FILE}"))]
    return [folder for folder in folders if folder.name not in slugs and not folder.is_symlink() and _is_ours(folder)]


def differences(compiled: Compiled, pipeline: File, out: Path) -> dict[str, str]:
    """What writing would change below ``out``, a unified diff by test, the pipeline's first; empty when up to date."""
    found = {pipeline.path: "".join(_difference(out, "", {pipeline.path: pipeline.text}, [pipeline.path]))}
    for name, wanted in ((SHARED, _of_all(compiled)), *((p.slug, _of_test(compiled, p)) for p in compiled.suite.plans)):
        found[name] = "".join(_difference(out / name, f"{name}/", wanted, _changed(out / name, wanted)))
    found.update((folder.name, f"only in {out.name}: {folder.name}\n") for folder in stale_folders(compiled, out))
    return {name: text for name, text in found.items() if text}


def _difference(folder: Path, shown: str, wanted: _Entries, changed: Sequence[str]) -> Iterator[str]:
    for name in changed:
        path, entry = folder / name, wanted.get(name)
        if isinstance(entry, str):
            before = path.read_text(encoding="utf-8", errors="replace") if path.is_file() else ""
            names = f"a/{shown}{name}", f"b/{shown}{name}"
            yield from difflib.unified_diff(before.splitlines(True), entry.splitlines(True), *names)
        else:
            yield f"{'differs' if entry else 'no longer needed'}: {shown}{name}\n"
