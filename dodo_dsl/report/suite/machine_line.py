"""How busy the machine was during a test, in a line."""

from dodo_dsl.outcome import MachineLoad, Wait


def machine_line(load: MachineLoad) -> str:
    """What application and services waited, what others took, and how many pictures were late."""
    parts = []
    if load.application is None or load.services is None or load.others_share is None:
        parts.append("waits for a processor were not measured")
    else:
        parts += [_waited("the application", load.application, load), _waited("DoDo's services", load.services, load)]
        parts.append(f"others took {load.others_share * 100:.0f} % of {load.cores} cores")
    if load.late_pictures_share:
        parts.append(
            f"{load.late_pictures_share * 100:.0f} % of the pictures came late, by up to {load.lateness_s:.2f} s"
        )
    if load.paused_s:
        parts.append(f"the emulated rig stood still for {load.paused_s:.2f} s")
    return "; ".join(parts)


def _waited(who: str, wait: Wait, load: MachineLoad) -> str:
    longest = f" ({wait.longest})" if wait.longest else ""
    return f"{who} waited {wait.waited_s:.1f} s of {load.duration_s:.1f} s for a processor{longest}"
