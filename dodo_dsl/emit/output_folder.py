"""Generated files on disk: written one by one, each as a whole, compared with existing ones, stale ones removed."""

import difflib
import errno
import filecmp
import json
import shutil
import stat
from collections.abc import Collection, Iterable, Iterator, Sequence
from pathlib import Path

from dodo_dsl import atomic
from dodo_dsl.emit.render import File, render_plan
from dodo_dsl.opendlv import regular_file
from dodo_dsl.plan.build import Compiled
from dodo_dsl.plan.test_files import FileCopy

PLAN_FILE = "test.json"
FILES = "files"


def pipeline_folder(out: Path) -> str:
    """The output folder as a pipeline's jobs name it: as it was given, or its last part when that is absolute."""
    return out.name if out.is_absolute() else out.as_posix()


def write(compiled: Compiled, pipeline: File, out: Path) -> None:
    """Writes everything below ``out`` and removes tests of earlier compilations that are no longer there.

    Raises NotReplaceable for a symlink in the folder of a test, before anything is written or removed.
    """
    for plan in compiled.suite.plans:
        _refuse_links(out / plan.slug)
    _update(out, [pipeline])
    for plan in compiled.suite.plans:
        folder, files, copies = out / plan.slug, render_plan(plan), compiled.copies[plan.slug]
        if folder.exists():
            _update(out, files)
            _write_copies(folder / FILES, copies)
        else:
            _write_new(folder, [(file.path.removeprefix(f"{plan.slug}/"), file.text) for file in files], copies)
    for folder in stale_folders(compiled, out):
        shutil.rmtree(folder)


def add_images(compiled: Compiled, images: Sequence[str], out: Path) -> None:
    """Adds lines ``DODO_IMAGE_<SERVICE>=<image>`` to the ``.env`` of each test that was written below ``out``."""
    for plan in compiled.suite.plans:
        path = out / plan.slug / ".env"
        atomic.write_text(path, "".join([path.read_text(encoding="utf-8"), *(f"{image}\n" for image in images)]))


def _refuse_links(folder: Path) -> None:
    for path in (folder, *folder.rglob("*")):
        if path.is_symlink():
            raise atomic.NotReplaceable(errno.ELOOP, "a symlink, which no output follows", str(path))


def _update(out: Path, files: Iterable[File]) -> None:
    for file in files:
        path = out / file.path
        if not path.is_file() or path.read_bytes() != file.text.encode():
            atomic.write_text(path, file.text)


def _write_new(folder: Path, files: Iterable[tuple[str, str]], copies: Sequence[FileCopy]) -> None:
    """A new test: its folder appears as a whole."""
    with atomic.new_folder(folder) as stage:
        for name, text in files:
            (stage / name).write_text(text, encoding="utf-8")
        for copy in copies:
            (stage / FILES / copy.target).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(copy.source, stage / FILES / copy.target)
        _open_to_containers(stage / FILES)


def _write_copies(folder: Path, wanted: Sequence[FileCopy]) -> None:
    for copy in wanted:
        target = folder / copy.target
        if not target.is_file() or not filecmp.cmp(copy.source, target, shallow=False):
            with atomic.replacing(target) as part:
                shutil.copyfile(copy.source, part)
    for path in _surplus(folder, wanted):
        path.unlink()
    _open_to_containers(folder)


def _open_to_containers(folder: Path) -> None:
    """Everybody may read the files, whatever the umask, as users of containers must; the folder above may be closed."""
    for path in (folder, *folder.rglob("*")) if folder.is_dir() else ():
        more = 0o555 if path.is_dir() else 0o444
        mode = path.stat().st_mode
        if mode & more != more:
            path.chmod(stat.S_IMODE(mode) | more)


def _surplus(folder: Path, wanted: Sequence[FileCopy]) -> Iterator[Path]:
    names = {copy.target for copy in wanted}
    for path in sorted(folder.rglob("*")):
        if path.is_file() and path.relative_to(folder).as_posix() not in names:
            yield path


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
    found = {pipeline.path: _text_difference(pipeline, out)}
    for plan in compiled.suite.plans:
        texts = (_text_difference(file, out) for file in render_plan(plan))
        copies = _copy_differences(out / plan.slug / FILES, compiled.copies[plan.slug], out)
        found[plan.slug] = "".join([*texts, *copies])
    found.update((folder.name, f"only in {out.name}: {folder.name}\n") for folder in stale_folders(compiled, out))
    return {name: text for name, text in found.items() if text}


def _text_difference(file: File, out: Path) -> str:
    path = out / file.path
    before = path.read_text(encoding="utf-8", errors="replace") if path.is_file() else ""
    if before == file.text:
        return ""
    names = (f"a/{file.path}", f"b/{file.path}")
    return "".join(difflib.unified_diff(before.splitlines(True), file.text.splitlines(True), *names))


def _copy_differences(folder: Path, wanted: Sequence[FileCopy], out: Path) -> Iterator[str]:
    for copy in wanted:
        target = folder / copy.target
        if not target.is_file() or not filecmp.cmp(copy.source, target, shallow=False):
            yield f"differs: {target.relative_to(out)}\n"
    for path in _surplus(folder, wanted):
        yield f"no longer needed: {path.relative_to(out)}\n"
