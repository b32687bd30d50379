"""``wrong-layer``: a service stands in a layer that its manifest names."""

from collections.abc import Iterator

from dodo_dsl.check.context import Context
from dodo_dsl.diagnostics import Diagnostic


def check(context: Context) -> Iterator[Diagnostic]:
    for use, manifest in context.known_uses():
        if use.layer not in manifest.layers:
            message = f"service '{manifest.name}' cannot stand in layer {use.layer}"
            yield Diagnostic(use.uses.span, "wrong-layer", message, f"move it to {' or '.join(manifest.layers)}")
