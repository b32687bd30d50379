"""The backend of a run that names none."""

from collections.abc import Sequence

from dodo_dsl.plan.model import Plan
from dodo_dsl.run.protocol import BackendError
from dodo_dsl.run.rigs.attendance import is_real
from dodo_dsl.run.runner import BackendName, default_backend


def choose(plans: Sequence[Plan]) -> BackendName:
    """Processes where the application allows it; else mixed on rigs and without DoDo's images; else docker."""
    by_application = default_backend(plans)
    if by_application == "process":
        return by_application
    from dodo_dsl.run.mixed.backends import may_enter

    if any(is_real(plan) for plan in plans) or (may_enter() and _lacks_images(plans)):
        return "mixed"
    return by_application


def _lacks_images(plans: Sequence[Plan]) -> bool:
    """Whether an engine of this machine lacks an image of DoDo's."""
    from docker.errors import DockerException, ImageNotFound

    from dodo_dsl.run.docker.client import connect

    try:
        client = connect()
        if not client.api.base_url.startswith("http+docker:"):
            return False
        for image in {service.image for plan in plans for service in plan.services}:
            client.api.inspect_image(image)
    except ImageNotFound:
        return True
    except (BackendError, DockerException, OSError):
        return False
    return False
