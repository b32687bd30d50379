"""Findings as diagnostics, at their places in the compose files.

``application-isolation``: access to the host that tests would share. ``application-hardware``: hardware, which is left
out of tests without a rig. ``application-limit``: a limit beyond that of the test, which takes its place.
"""

from dodo_dsl import source
from dodo_dsl.application.access.model import AccessFinding, Steps
from dodo_dsl.diagnostics import Diagnostic, Span
from dodo_dsl.source import Node, Scalar


def diagnostic(finding: AccessFinding, node: Node, key: Span) -> Diagnostic:
    """A finding within a node, whose own key is at ``key``."""
    span = place(node, finding.steps, key)
    if finding.kind == "unknown":
        hint = finding.hint or _new(finding.steps[-1])
        return Diagnostic(_key(node, finding.steps, span), "unknown-key", finding.message, hint, fix=finding.fix)
    if finding.kind == "limit":
        return Diagnostic(span, "application-limit", finding.message, finding.hint, "warning")
    if finding.kind == "left out":
        return Diagnostic(span, "application-isolation", finding.message, finding.hint, "warning")
    if finding.kind != "refused":
        hint = finding.hint or "test it on a rig (level hil)"
        return Diagnostic(span, "application-hardware", finding.message, hint, "warning")
    return Diagnostic(span, "application-isolation", finding.message, finding.hint)


def place(node: Node, steps: Steps, key: Span) -> Span:
    """The place of the value that the steps lead to, or of its key where it has no text of its own."""
    span = key
    for step in steps:
        if isinstance(node, source.Mapping) and step in node.entries:
            entry = node.entries[str(step)]
            node = entry.value
            span = node.span if isinstance(node, Scalar) and node.text else entry.key
        elif isinstance(node, source.Sequence) and isinstance(step, int) and step < len(node.items):
            node = node.items[step]
            span = node.span
    return span


def _key(node: Node, steps: Steps, otherwise: Span) -> Span:
    """The place of the last step's key."""
    for step in steps[:-1]:
        if isinstance(node, source.Mapping):
            node = node.entries[str(step)].value
        elif isinstance(node, source.Sequence) and isinstance(step, int):
            node = node.items[step]
    last = str(steps[-1])
    return node.entries[last].key if isinstance(node, source.Mapping) and last in node.entries else otherwise


def _new(key: object) -> str:
    return f"a key of your own begins with x-, as x-{key}; docs/reference/compose-keys.md has compose's"
