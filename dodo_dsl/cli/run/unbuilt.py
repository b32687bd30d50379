"""Shipped tests on the emulated rig where that is not built: nobody asked for them, so they are left out."""

from dataclasses import replace

from dodo_dsl.check.resolve import ResolvedTest
from dodo_dsl.compiler import Checked, narrowed
from dodo_dsl.spec.deployment.rig import EMULATED, PORT
from dodo_dsl.terminal import printable


def without_unbuilt(checked: Checked, backend: str | None) -> tuple[Checked, str]:
    """The same without such tests, and a line about them; with containers, the rig is in an image."""
    if not _runs_processes(checked, backend):
        return checked, ""
    left_out = {test.spec.path for test in checked.tests if test.spec.path in checked.unasked and _is_emulated(test)}
    if not left_out or _is_built():
        return checked, ""
    known, kept = set(checked.diagnostics), [spec for spec in checked.specs if spec.path not in left_out]
    fewer = narrowed(checked, kept)
    names = printable(", ".join(sorted({spec.location.stem for spec in checked.specs if spec.path in left_out})))
    said = f"skipped shipped tests on the emulated rig, which is not built: {names} (see dodo doctor)\n"
    return replace(fewer, diagnostics=tuple(d for d in fewer.diagnostics if d in known)), said


def _runs_processes(checked: Checked, backend: str | None) -> bool:
    if checked.application is None:
        return False
    services = checked.application.services.values()
    by_default = all("x-dodo-process" in service.node.entries for service in services)
    return by_default if backend is None else backend != "docker"


def _is_emulated(test: ResolvedTest) -> bool:
    """Whether the rig's firmware runs in the simulator; for a camera alone, nothing has to be built."""
    ports = (
        service.texts.get(name)
        for service in test.services
        for name, parameter in service.manifest.parameters.items()
        if parameter.rig == PORT
    )
    return EMULATED in ports


def _is_built() -> bool:
    from dodo_dsl.run.capabilities.programs import emulator_folder

    return emulator_folder() is not None
