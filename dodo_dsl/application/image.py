"""The image of a service, and how it is built."""

import re
from typing import TYPE_CHECKING, Any

from dodo_dsl import source
from dodo_dsl.application.interpolation import escaped
from dodo_dsl.application.merge import is_local
from dodo_dsl.application.model import environment, image_variable, plain, text
from dodo_dsl.diagnostics import Diagnostic, Span
from dodo_dsl.source import Node

if TYPE_CHECKING:
    from dodo_dsl.application.container import Container

_REMOTE = ("http://", "https://", "git://", "ssh://", "git@", "github.com/", "docker-image://", "service:", "target:")
_AROUND_NAME = re.compile(r"^(index\.)?docker\.io/|:[^/:@]*(@.*)?\Z|@.*\Z", re.DOTALL)
"""The registry that the engine takes by default, tag and digest."""
_BASES = ("python", "library/python", "debian", "library/debian")
"""What DoDo's images, and those of many others, are built on."""


def image(c: "Container", node: Node) -> Any:
    """The image of the file, unless a pipeline sets another one."""
    return f"${{{image_variable(c.name)}:-{text(plain(node))}}}"


def build(c: "Container", node: Node) -> Any:
    image, paths = c.service.node.get("image"), c.project.paths
    name = _AROUND_NAME.sub("", text(plain(image))) if image is not None else ""
    if name.startswith("dodo/") or name in _BASES:
        which = "one of DoDo's own" if name.startswith("dodo/") else "one on which others are built"
        c.refuse(node.span, f"the image '{name}' of '{c.name}' would replace {which}", "give the image another name")
    if image is None:
        c.own["image"] = f"${{{image_variable(c.name)}:-}}"
    fields = c.fields(
        node, f"the build of '{c.name}'",
        "context dockerfile dockerfile_inline args target additional_contexts secrets",
        "cache_from cache_to entitlements extra_hosts isolation labels no_cache no_cache_filter platforms privileged"
        " provenance pull sbom shm_size ssh tags ulimits",
        {"network": ("reaches services of the host", "remove it", "default", "none")},
    )  # fmt: skip
    made: dict[str, Any] = {
        key: plain(fields[key]) for key in ("dockerfile_inline", "target", "secrets", "network") if key in fields
    }
    if (context := c.literal(fields["context"]) if "context" in fields else ".") is not None:
        span = fields["context"].span if "context" in fields else node.span
        made = {"context": _context(c, span, context), **made}
        if is_local(context) and paths.is_own(context) and not (paths.folder / context).is_dir():
            hint = "create it, or remove 'build'; paths are relative to this file"
            message = f"there is no folder '{context}'"  # a warning, as an image or a variable for it may stand in
            c.add(Diagnostic(span, "application-file", message, hint, "warning"))
        if "dockerfile" in fields and (file := c.literal(fields["dockerfile"])):
            if not context.startswith(_REMOTE):
                c.path(file, fields["dockerfile"].span, base=context)
            made["dockerfile"] = escaped(file)
    if "args" in fields:
        made["args"] = _arguments(c, plain(fields["args"]))
    others = source.entries(fields.get("additional_contexts"))
    if found := {name: _context(c, e.value.span, word) for name, e in others.items() if (word := c.literal(e.value))}:
        made["additional_contexts"] = found
    return made


def _context(c: "Container", span: Span, context: str) -> str:
    """What is built: a folder of the repository, an image or a URL."""
    paths = c.project.paths
    is_here = any((place / context).exists() for place in (paths.folder, *paths.roots)) if "\0" not in context else True
    if context.startswith(_REMOTE) and ".." not in context.split("/") and not is_here:
        return escaped(context)
    if "://" in context:
        c.refuse(span, f"'{context}' is of a kind that may be a file of the host", "keep it in the repository")
        return ""
    return c.path(context, span) or ""


def _arguments(c: "Container", written: Any) -> dict[str, str | None]:
    """Arguments of a build; those without a value have that of the variable of their name, or are left out."""
    application = c.project.application
    made: dict[str, str | None] = {}
    for name, value in environment(written).items():
        if value is not None or application.is_late(name):
            made[name] = value
        elif name in application.known:
            made[name] = application.known[name].replace("$", "$$")
    return made
