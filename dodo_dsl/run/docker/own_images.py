"""Images of DoDo's services and a user's own: where they come from when the engine and its registry have none."""

from dodo_dsl.plan.model import Plan
from dodo_dsl.run.process.commands import own_module
from dodo_dsl.spec.deployment.deployment import build_command


def hints(plan: Plan) -> dict[str, str]:
    """How to get each image that has the prefix and the tag of DoDo's, by its reference."""
    prefix, _, last = plan.sandbox_image.rpartition("/")
    tag = last.rpartition(":")[2]
    all_of_them = f"'{build_command(prefix, tag)}' makes it"
    found = {plan.sandbox_image: all_of_them}
    for service in plan.services:
        place, _, image = service.image.rpartition("/")
        name, _, version = image.rpartition(":")
        if (place, version) != (prefix, tag):
            continue
        if own_module(service.process):
            found[service.image] = all_of_them
        else:
            command = build_command(prefix, tag, name)
            found[service.image] = f"build it from your own Dockerfile on {prefix}/base:{tag}: {command}"
    return found
