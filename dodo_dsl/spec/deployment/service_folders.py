"""``services`` of a deployment: folders that hold a folder with a manifest for each service."""

from collections.abc import Iterator
from pathlib import Path

from dodo_dsl.diagnostics import Diagnostic
from dodo_dsl.source import Node, Scalar, path_of, walk

RULE = "service-folder"
MANIFEST = "service.yml"
_TAKEN = ("services", "dodo_dsl")


def problems(root: Path, node: Node | None) -> Iterator[Diagnostic]:
    """Folders that are a service themselves, and warnings for those without any and those that DoDo's packages hide.

    Folders that do not exist are reported elsewhere.
    """
    for item in walk(node) if node is not None else ():
        folder = path_of(root, item.text) if isinstance(item, Scalar) else None
        if folder is None or not isinstance(item, Scalar) or not folder.is_dir():
            continue
        if (folder / MANIFEST).is_file():
            yield Diagnostic(item.span, RULE, f"'{item.text}' is the folder of one service", _above(root, folder))
        elif not any(folder.glob(f"*/{MANIFEST}")):
            message = f"'{item.text}' holds no service"
            hint = f"a service is a folder in it with a {MANIFEST}: {item.text.rstrip('/')}/NAME/{MANIFEST}"
            yield Diagnostic(item.span, RULE, message, hint, severity="warning")
        elif folder.name in _TAKEN:
            message = f"Python finds DoDo's own package '{folder.name}' before this folder"
            hint = f"give it another name, such as my_{folder.name}, also in 'process' of its services"
            yield Diagnostic(item.span, RULE, message, hint, severity="warning")


def _above(root: Path, folder: Path) -> str:
    above, root = folder.parent, root.resolve()
    if above != root and above.is_relative_to(root):
        return f"name the folder above it: {above.relative_to(root).as_posix()}"
    return f"move it to my_services/{folder.name}, and name the folder above it: my_services"
