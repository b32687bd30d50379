"""What a test may be called: as its file, which is a job of a pipeline, too."""

import re

from dodo_dsl.source import resolve

KEYWORDS = frozenset(
    {
        "after-script",
        "before-script",
        "cache",
        "default",
        "false",
        "gate",
        "image",
        "include",
        "nil",
        "pages",
        "services",
        "spec",
        "stages",
        "true",
        "types",
        "variables",
        "workflow",
    }
)
"""Of GitLab's pipelines, which cannot name a job."""
_LONGEST = 60
_NAME = re.compile(r"[a-z][a-z0-9]*(-[a-z0-9]+)*")


def is_name(text: str) -> bool:
    """Whether a test may be called so, but for keywords."""
    return len(text) <= _LONGEST and _NAME.fullmatch(text) is not None


def is_free(text: str) -> bool:
    """Whether a test may be called so, and YAML takes it for a text."""
    return is_name(text) and text not in KEYWORDS and resolve(text) == text


def near(text: str) -> str:
    """A name like a text."""
    slug = re.sub(r"[^a-z0-9]+", "-", text.lower()).strip("-")
    return next(filter(is_free, (slug[:_LONGEST].strip("-"), f"sil-{slug}"[:_LONGEST].strip("-"))), "sil-test")


def as_file(stem: str, ending: str) -> str:
    """A hint for a test in a file of this name: the name, where it may have it, or another for both."""
    if is_free(stem):
        return f"write 'name: {stem}', as the file is called"
    return f"rename the file to {near(stem)}{ending}, and write 'name: {near(stem)}'"
