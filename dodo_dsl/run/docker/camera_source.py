"""Cameras that containers of DoDo's cannot have."""

from dodo_dsl.plan.model import Plan
from dodo_dsl.run.protocol import BackendError
from dodo_dsl.spec.deployment.rig import CAMERA_SOURCE, RPICAM

_FLAG = CAMERA_SOURCE.rpartition(".")[2]


def refuse_rpicam(plan: Plan) -> None:
    """Raises BackendError where a service takes pictures by ``rpicam-vid``, a program of the rig's computer."""
    for service in plan.services:
        if any((flag.name, flag.value) == (_FLAG, RPICAM) for flag in service.flags):
            raise BackendError(
                f"service '{service.name}' needs the program rpicam-vid of the rig's computer, which containers do not "
                "have: use --backend mixed or process"
            )
