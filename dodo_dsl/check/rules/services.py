"""``unknown-service``: ``uses`` names a service with a manifest; ``service-taken``: names in a test are unique.

``service-reserved``: DoDo adds services of its own to every test.
"""

from collections.abc import Iterator

from dodo_dsl.check.context import Context
from dodo_dsl.diagnostics import Diagnostic, did_you_mean


def check(context: Context) -> Iterator[Diagnostic]:
    first_layer: dict[str, str] = {}
    for use in context.spec.uses:
        if use.uses.text not in context.manifests:
            hint = did_you_mean(use.uses.text, context.manifests)
            yield Diagnostic(use.uses.span, "unknown-service", f"there is no service '{use.uses.text}'", hint)
        if use.name == "sandbox" or use.name.startswith("dodo-"):
            message = f"the name '{use.name}' is kept for DoDo's own services"
            yield Diagnostic(use.span, "service-reserved", message, "choose another; 'sandbox' and 'dodo-...' are kept")
        if use.name in first_layer:
            message = f"the name '{use.name}' stands in layer {first_layer[use.name]} already"
            yield Diagnostic(use.span, "service-taken", message, "services of a test have names of their own")
        first_layer.setdefault(use.name, use.layer)
