"""Generated files on disk: written one by one, each as a whole, compared with existing ones, stale ones removed."""

import difflib
import errno
import filecmp
import json
import shutil
import stat
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from dodo_dsl import atomic
from dodo_dsl.emit.render import PLAN_FILE, File, render_plan
from dodo_dsl.opendlv import regular_file
from dodo_dsl.plan.build import Compiled
from dodo_dsl.plan.model import Plan
from dodo_dsl.plan.test_files import SHARED, is_shared_name, link

FILES = "files"


@dataclass(frozen=True)
class _Link:
    text: str


_Entry = str | Path | _Link
"""What stands at a path: a text, the copy of a file, or a link."""
_Entries = Mapping[Path, _Entry]


def _of_test(compiled: Compiled, plan: Plan, out: Path) -> dict[Path, _Entry]:
    """Everything in the folder of a test."""
    files = out / plan.slug / FILES
    copies = (
        (files / copy.target, _Link(copy.link) if copy.shared else copy.source) for copy in compiled.copies[plan.slug]
    )
    return {**{out / file.path: file.text for file in render_plan(plan)}, **dict(copies)}


def _of_all(compiled: Compiled, out: Path) -> dict[Path, _Entry]:
    """The files that tests share; the name depends on the content."""
    return {out / SHARED / copy.shared: copy.source for c in compiled.copies.values() for copy in c if copy.shared}


def write(compiled: Compiled, pipeline: File, out: Path) -> None:
    """Writes everything below ``out`` and removes tests of earlier compilations that are no longer there.

    Raises NotReplaceable for a symlink in the folder of a test, before anything is written or removed.
    """
    for plan in compiled.suite.plans:
        _refuse_links(out / plan.slug)
    _refuse_link(out / SHARED)
    shared = _of_all(compiled, out)
    _update({out / pipeline.path: pipeline.text, **shared})
    for plan in compiled.suite.plans:
        folder, wanted = out / plan.slug, _of_test(compiled, plan, out)
        if folder.exists():
            for path in _surplus(folder / FILES, wanted):  # before anything else: a folder may replace it
                path.unlink()
            _update(wanted)
            _open_to_containers(folder / FILES)
        else:
            _write_new(folder, wanted)
    for stale in stale_folders(compiled, out):
        shutil.rmtree(stale)
    for path in _surplus(out / SHARED, shared):
        path.unlink()
    _open_to_containers(out / SHARED)
    if (out / SHARED).is_dir() and not any((out / SHARED).iterdir()):
        (out / SHARED).rmdir()


def _update(wanted: _Entries) -> None:
    for path, entry in wanted.items():
        if _is_written(path, entry):
            continue
        if isinstance(entry, _Link) or (isinstance(entry, Path) and path.is_symlink()):
            path.unlink(missing_ok=True)
        if isinstance(entry, _Link):
            path.parent.mkdir(parents=True, exist_ok=True)
            _put(path, entry)
        else:
            with atomic.replacing(path) as part:
                _put(part, entry)


def _write_new(folder: Path, wanted: _Entries) -> None:
    """A new test: its folder appears as a whole."""
    with atomic.new_folder(folder) as stage:
        staged = {stage / path.relative_to(folder): entry for path, entry in wanted.items()}
        for parent in {path.parent for path in staged}:
            parent.mkdir(parents=True, exist_ok=True)
        for path, entry in staged.items():
            _put(path, entry)
        _open_to_containers(stage / FILES)


def _put(path: Path, entry: _Entry) -> None:
    if isinstance(entry, _Link):
        path.symlink_to(entry.text)
    elif isinstance(entry, Path):
        shutil.copyfile(entry, path)
    else:
        path.write_bytes(entry.encode())


def _is_written(path: Path, entry: _Entry) -> bool:
    if isinstance(entry, _Link):
        return path.is_symlink() and str(path.readlink()) == entry.text
    if path.is_symlink() or not path.is_file():
        return False
    return path.read_bytes() == entry.encode() if isinstance(entry, str) else filecmp.cmp(entry, path, shallow=False)


def _surplus(folder: Path, wanted: _Entries) -> list[Path]:
    """What earlier compilations put into a folder, and this one does not."""
    found = [path for path in sorted(folder.rglob("*")) if path.is_symlink() or path.is_file()]
    return [p for p in found if p not in wanted and (folder.name == FILES or is_shared_name(p.name))]


def add_images(compiled: Compiled, images: Sequence[str], out: Path) -> None:
    """Adds lines ``DODO_IMAGE_<SERVICE>=<image>`` to the ``.env`` of each test that was written below ``out``."""
    for plan in compiled.suite.plans:
        path = out / plan.slug / ".env"
        atomic.write_text(path, "".join([path.read_text(encoding="utf-8"), *(f"{image}\n" for image in images)]))


def _refuse_links(folder: Path) -> None:
    for path in (folder, *folder.rglob("*")):
        if not _is_own_link(path, folder / FILES):
            _refuse_link(path)


def _refuse_link(path: Path) -> None:
    if path.is_symlink():
        raise atomic.NotReplaceable(errno.ELOOP, "a symlink, which no output follows", str(path))


def _is_own_link(path: Path, files: Path) -> bool:
    """Whether it is a link to a shared file, as ``dodo compile`` writes them; nothing is written through it."""
    if not path.is_symlink() or not path.is_relative_to(files) or path == files:
        return False
    text = path.readlink()
    return is_shared_name(text.name) and str(text) == link(path.relative_to(files).as_posix(), text.name)


def _open_to_containers(folder: Path) -> None:
    """Everybody may read the files, for any umask, as users of containers must; the folder above may be closed."""
    for path in (folder, *folder.rglob("*")) if folder.is_dir() else ():
        if path.is_symlink():
            continue
        more = 0o555 if path.is_dir() else 0o444
        mode = path.stat().st_mode
        if mode & more != more:
            path.chmod(stat.S_IMODE(mode) | more)


def stale_folders(compiled: Compiled, out: Path) -> list[Path]:
    """Tests of earlier compilations that are not in this one."""
    slugs = {plan.slug for plan in compiled.suite.plans}
    return [path.parent for path in sorted(out.glob(f"*/{PLAN_FILE}")) if _is_stale(path, slugs)]


def _is_stale(path: Path, slugs: Collection[str]) -> bool:
    return path.parent.name not in slugs and not path.parent.is_symlink() and _ours(path)


def _ours(path: Path) -> bool:
    try:
        return bool(json.loads(regular_file.text(path)).get("dodo") == "plan")
    except (OSError, ValueError, AttributeError):
        return False


def differences(compiled: Compiled, pipeline: File, out: Path) -> dict[str, str]:
    """What writing would change below ``out``, a unified diff by test, the pipeline's first; empty when up to date."""
    found = {pipeline.path: _difference({out / pipeline.path: pipeline.text}, out)}
    for plan in compiled.suite.plans:
        wanted = _of_test(compiled, plan, out)
        found[plan.slug] = _difference(wanted, out, out / plan.slug / FILES)
    found[SHARED] = _difference(_of_all(compiled, out), out, out / SHARED)
    found.update((folder.name, f"only in {out.name}: {folder.name}\n") for folder in stale_folders(compiled, out))
    return {name: text for name, text in found.items() if text}


def _difference(wanted: _Entries, out: Path, folder: Path | None = None) -> str:
    lines: list[str] = []
    for path, entry in wanted.items():
        name = path.relative_to(out).as_posix()
        if _is_written(path, entry):
            continue
        if isinstance(entry, str):
            before = path.read_text(encoding="utf-8", errors="replace") if path.is_file() else ""
            lines += difflib.unified_diff(before.splitlines(True), entry.splitlines(True), f"a/{name}", f"b/{name}")
        else:
            lines.append(f"differs: {name}\n")
    surplus = _surplus(folder, wanted) if folder else ()
    return "".join([*lines, *(f"no longer needed: {path.relative_to(out)}\n" for path in surplus)])
