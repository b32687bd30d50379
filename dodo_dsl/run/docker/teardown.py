"""The end of a test's containers: stopped, their reports copied, and removed."""

from collections.abc import Callable, Collection, Mapping
from pathlib import Path
from typing import Any

from dodo_dsl.emit.containers import REPORT
from dodo_dsl.plan.model import Plan
from dodo_dsl.run.docker.archive import copy_out
from dodo_dsl.run.docker.cleanup import remove_project, stop_project
from dodo_dsl.run.docker.client import engine_error


def writers(plan: Plan) -> set[str]:
    """The services that write files of the report."""
    return {service.name for service in plan.services if any(flag.kind == "report" for flag in service.flags)}


def take_down(
    client: Any,
    project: str,
    containers: Mapping[str, Any],
    report: tuple[Collection[str], Path],
    note: Callable[[str], None],
) -> bool:
    """Whether everything was removed; ``report`` are the services that write it, and its folder.

    The next run removes what cannot be removed now, as when the engine has stopped.
    """
    try:
        stop_project(client, project)
        for name in report[0]:
            if name in containers:
                _copy_report(containers[name], name, report[1], note)
        remove_project(client, project)
    except Exception as error:  # noqa: BLE001  (whatever it was, the record of the project has to stay)
        reason = engine_error(error)
        note(f"the engine cannot remove the test's containers ({reason}): the next run or 'dodo doctor --clean' does")
        return False
    return True


def _copy_report(container: Any, name: str, folder: Path, note: Callable[[str], None]) -> None:
    from docker.errors import DockerException

    try:
        copy_out(container, f"{REPORT}/.", folder)
    except (DockerException, OSError) as error:
        note(f"the report misses files of {name}: {engine_error(error)}")
