"""Generated files on disk: written one by one, each as a whole, compared with existing ones, stale ones removed."""

import difflib
import errno
import filecmp
import json
import os
import shutil
import stat
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from pathlib import Path

from dodo_dsl import atomic
from dodo_dsl.emit.render import File, render_plan
from dodo_dsl.opendlv import regular_file
from dodo_dsl.plan.build import Compiled
from dodo_dsl.plan.test_files import SHARED, FileCopy, is_shared_name, link

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
    _refuse_link(out / SHARED)
    _update(out, [pipeline])
    _write_shared(out / SHARED, _shared(compiled))
    for plan in compiled.suite.plans:
        folder, files, copies = out / plan.slug, render_plan(plan, compiled.defaults), compiled.copies[plan.slug]
        if folder.exists():
            _update(out, files)
            _write_copies(folder / FILES, copies)
        else:
            _write_new(folder, [(file.path.removeprefix(f"{plan.slug}/"), file.text) for file in files], copies)
    for folder in stale_folders(compiled, out):
        shutil.rmtree(folder)
    _remove_unshared(out / SHARED, _shared(compiled))


def _shared(compiled: Compiled) -> dict[str, FileCopy]:
    """The files that tests share, by name."""
    return {copy.shared: copy for copies in compiled.copies.values() for copy in copies if copy.shared}


def _write_shared(folder: Path, wanted: Mapping[str, FileCopy]) -> None:
    """Copies of files, or links to those of the repository; the name depends on the content."""
    for name, copy in wanted.items():
        if _is_shared_as(folder / name, copy):
            continue
        if copy.is_linked:
            folder.mkdir(parents=True, exist_ok=True)
            (folder / name).unlink(missing_ok=True)
            (folder / name).symlink_to(_repository_link(folder, copy))
        else:
            with atomic.replacing(folder / name) as part:
                shutil.copyfile(copy.source, part)
    if wanted:
        _open_to_containers(folder)


def _is_shared_as(path: Path, copy: FileCopy) -> bool:
    if copy.is_linked:
        return path.is_symlink() and path.readlink() == _repository_link(path.parent, copy)
    return path.is_file() and not path.is_symlink() and filecmp.cmp(copy.source, path, shallow=False)


def _repository_link(folder: Path, copy: FileCopy) -> Path:
    return Path(os.path.relpath(copy.source, folder.resolve()))


def _remove_unshared(folder: Path, wanted: Mapping[str, FileCopy]) -> None:
    for path in _unshared(folder, wanted):
        path.unlink()
    if folder.is_dir() and not any(folder.iterdir()):
        folder.rmdir()


def _unshared(folder: Path, wanted: Mapping[str, FileCopy]) -> list[Path]:
    """What earlier compilations shared and this one does not."""
    found = sorted(folder.iterdir()) if folder.is_dir() else []
    files = [path for path in found if path.is_symlink() or path.is_file()]
    return [path for path in files if is_shared_name(path.name) and path.name not in wanted]


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
            target = stage / FILES / copy.target
            target.parent.mkdir(parents=True, exist_ok=True)
            if copy.shared:
                target.symlink_to(copy.link)
            else:
                shutil.copyfile(copy.source, target)
        _open_to_containers(stage / FILES)


def _write_copies(folder: Path, wanted: Sequence[FileCopy]) -> None:
    for path in _former_links(folder, wanted):  # before anything else: a folder may replace it
        path.unlink()
    for copy in wanted:
        if _is_copied(folder, copy):
            continue
        if copy.shared:
            (folder / copy.target).parent.mkdir(parents=True, exist_ok=True)
            (folder / copy.target).unlink(missing_ok=True)
            (folder / copy.target).symlink_to(copy.link)
        else:
            with atomic.replacing(folder / copy.target) as part:
                shutil.copyfile(copy.source, part)
    for path in _surplus(folder, wanted):
        path.unlink()
    _open_to_containers(folder)


def _former_links(folder: Path, wanted: Sequence[FileCopy]) -> list[Path]:
    links = {copy.target: copy.link for copy in wanted if copy.shared}
    found = [path for path in folder.rglob("*") if path.is_symlink()]
    return [path for path in found if links.get(path.relative_to(folder).as_posix()) != str(path.readlink())]


def _is_copied(folder: Path, copy: FileCopy) -> bool:
    target = folder / copy.target
    if copy.shared:
        return target.is_symlink() and str(target.readlink()) == copy.link
    return target.is_file() and not target.is_symlink() and filecmp.cmp(copy.source, target, shallow=False)


def _open_to_containers(folder: Path) -> None:
    """Everybody may read the files, for any umask, as users of containers must; the folder above may be closed."""
    for path in (folder, *folder.rglob("*")) if folder.is_dir() else ():
        if path.is_symlink():
            continue
        more = 0o555 if path.is_dir() else 0o444
        mode = path.stat().st_mode
        if mode & more != more:
            path.chmod(stat.S_IMODE(mode) | more)


def _surplus(folder: Path, wanted: Sequence[FileCopy]) -> Iterator[Path]:
    names = {copy.target for copy in wanted}
    for path in sorted(folder.rglob("*")):
        if (path.is_file() or path.is_symlink()) and path.relative_to(folder).as_posix() not in names:
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
        texts = (_text_difference(file, out) for file in render_plan(plan, compiled.defaults))
        copies = _copy_differences(out / plan.slug / FILES, compiled.copies[plan.slug], out)
        found[plan.slug] = "".join([*texts, *copies])
    found[SHARED] = "".join(_shared_differences(out / SHARED, _shared(compiled)))
    found.update((folder.name, f"only in {out.name}: {folder.name}\n") for folder in stale_folders(compiled, out))
    return {name: text for name, text in found.items() if text}


def _text_difference(file: File, out: Path) -> str:
    path = out / file.path
    before = path.read_text(encoding="utf-8", errors="replace") if path.is_file() else ""
    if before == file.text:
        return ""
    names = (f"a/{file.path}", f"b/{file.path}")
    return "".join(difflib.unified_diff(before.splitlines(True), file.text.splitlines(True), *names))


def _shared_differences(folder: Path, wanted: Mapping[str, FileCopy]) -> Iterator[str]:
    for name, copy in wanted.items():
        if not _is_shared_as(folder / name, copy):
            yield f"differs: {SHARED}/{name}\n"
    for path in _unshared(folder, wanted):
        yield f"no longer needed: {SHARED}/{path.name}\n"


def _copy_differences(folder: Path, wanted: Sequence[FileCopy], out: Path) -> Iterator[str]:
    for copy in wanted:
        if not _is_copied(folder, copy):
            yield f"differs: {(folder / copy.target).relative_to(out)}\n"
    for path in _surplus(folder, wanted):
        yield f"no longer needed: {path.relative_to(out)}\n"
