"""Images of services that are a user's own: where they come from when the engine and its registry have none."""

from dodo_dsl.plan.model import Plan
from dodo_dsl.run.process.commands import own_module


def hints(plan: Plan) -> dict[str, str]:
    """How to get each own image that has the prefix and the tag of DoDo's, by its reference."""
    prefix, _, last = plan.sandbox_image.rpartition("/")
    tag = last.rpartition(":")[2]
    found = {}
    for service in plan.services:
        place, _, image = service.image.rpartition("/")
        name, _, version = image.rpartition(":")
        if not own_module(service.process) and (place, version) == (prefix, tag):
            base = f"{prefix}/base:{tag}"
            found[service.image] = f"build it from your own Dockerfile on {base}: dodo images build {name}"
    return found
