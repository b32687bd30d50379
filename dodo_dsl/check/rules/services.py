"""``unknown-service``: ``uses`` names a service with a manifest; ``service-taken``: names in a test are unique."""

from collections.abc import Iterator

from dodo_dsl.check.context import Context
from dodo_dsl.diagnostics import Diagnostic, did_you_mean


def check(context: Context) -> Iterator[Diagnostic]:
    first_layer: dict[str, str] = {}
    for use in context.spec.uses:
        if use.uses.text not in context.manifests:
            hint = did_you_mean(use.uses.text, context.manifests)
            yield Diagnostic(use.uses.span, "unknown-service", f"there is no service '{use.uses.text}'", hint)
        if use.name in first_layer:
            message = f"the name '{use.name}' stands in layer {first_layer[use.name]} already"
            yield Diagnostic(use.span, "service-taken", message, "services of a test have names of their own")
        first_layer.setdefault(use.name, use.layer)
