"""``unknown-service``: ``uses`` names a service with a manifest; ``service-taken``: names in a test are unique.

``service-reserved``: DoDo adds services of its own to every test.
"""

from collections.abc import Iterator

from dodo_dsl.check.context import RuleContext
from dodo_dsl.diagnostics import Diagnostic, did_you_mean, only_fix
from dodo_dsl.spec.deployment.service_folders import MANIFEST


def check(context: RuleContext) -> Iterator[Diagnostic]:
    first_layer: dict[str, str] = {}
    for use in context.spec.uses:
        if use.uses.text not in context.manifests and not _is_broken(context, use.uses.text):
            hint = did_you_mean(use.uses.text, context.manifests)
            message, fix = f"unknown service '{use.uses.text}'", only_fix(use.uses.text, context.manifests)
            yield Diagnostic(use.uses.span, "unknown-service", message, hint, fix=fix)
        if use.name == "sandbox" or use.name.startswith("dodo-"):
            message = f"the name '{use.name}' is reserved for DoDo's own services"
            hint = "choose another name; 'sandbox' and 'dodo-...' are reserved"
            yield Diagnostic(use.span, "service-reserved", message, hint)
        if use.name in first_layer:
            message = f"the name '{use.name}' is already used in layer {first_layer[use.name]}"
            yield Diagnostic(use.span, "service-taken", message, "the names of a test's services are unique")
        first_layer.setdefault(use.name, use.layer)


def _is_broken(context: RuleContext, name: str) -> bool:
    """Whether there is a service of the user's own in a folder of this name, whose manifest is reported itself."""
    read = {manifest.folder for manifest in context.manifests.values()}
    parts = (name, name.replace("-", "_"))
    named = context.deployment.services
    folders = [*(above / part for above in named for part in parts), *(own for own in named if own.name in parts)]
    return any(folder not in read and (folder / MANIFEST).is_file() for folder in folders)
