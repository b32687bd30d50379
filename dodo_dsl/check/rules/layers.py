"""``wrong-layer``: a service is in a layer that its manifest lists."""

from collections.abc import Iterator

from dodo_dsl.check.context import RuleContext
from dodo_dsl.diagnostics import Diagnostic


def check(context: RuleContext) -> Iterator[Diagnostic]:
    for service in context.services:
        use, manifest = service.use, service.manifest
        if use.layer not in manifest.layers:
            message = f"service '{manifest.name}' does not fit layer {use.layer}"
            hint = f"move it to {' or '.join(manifest.layers)}"
            yield Diagnostic(use.uses.span, "wrong-layer", message, hint, about=tuple(manifest.layers))
