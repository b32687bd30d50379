"""``docker compose`` for the application of a compiled test alone."""

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from dodo_dsl.application import compose_paths
from dodo_dsl.application.model import FILES, SANDBOX
from dodo_dsl.run.docker.compose import Compose
from dodo_dsl.run.mixed.holder import copier, holder
from dodo_dsl.run.process import namespaces
from dodo_dsl.run.process.commands import needed_paths
from dodo_dsl.run.process.entered import Entered

_APPLICATION_FILE = "application.compose.yml"
_TMP = "tmp"


class ApplicationCompose(Compose):
    """The compiled test without DoDo's services; under network isolation with a container that holds its network."""

    _replacing = ""

    def _take(self, config: dict[str, Any]) -> None:
        names = {service.name for service in self.plan.application.services}
        self.services = {name: service for name, service in config["services"].items() if name in names}
        self._volumes = config.get("volumes") or {}
        own: dict[str, Any] = {}
        if self.plan.isolation == "network":
            own["services"] = {SANDBOX: holder(self.plan.slug)}
            network = config["networks"]["default"]
            planned = network["ipam"]["config"][0]["subnet"]
            subnet = {"config": [{"subnet": f"${{DODO_SUBNET:-{planned}}}"}]}
            options = compose_paths.escaped_values(network.get("driver_opts") or {})
            own["networks"] = {"default": {"driver_opts": options, "ipam": subnet}}
            options = compose_paths.escaped_values(self._volumes[_TMP].get("driver_opts") or {})
            own["volumes"] = {_TMP: {"driver_opts": options}}
            self.services[SANDBOX] = own["services"][SANDBOX]
        if FILES in config["services"]:
            self.services[FILES] = copier(config["services"][FILES])
            own.setdefault("services", {})[FILES] = compose_paths.escaped_values(self.services[FILES])
        self._replacing = replacing(self.services, names, own)

    def _masks(self) -> tuple[dict[str, Any], list[str]]:
        """With mounts over the folders in ``/tmp`` where DoDo's processes have theirs: so no container removes them."""
        masked, problems = super()._masks()
        if self.plan.isolation == "network":
            shown = Entered.with_own(0, *needed_paths(self.plan, self.folder, self.report)).shown
            application = {one.name: self.services[one.name] for one in self.plan.application.services
                           if one.name in self.services}  # fmt: skip
            for name, mounts in covers(application, shown).items():
                given = masked.setdefault(name, {"volumes": []})["volumes"]
                given += [mount for mount in mounts if mount["target"] not in {one["target"] for one in given}]
        return masked, problems

    def _files(self, folder: Path) -> list[str]:
        path = folder / "mixed.compose.yml"
        path.write_text(self._replacing, encoding="utf-8")
        return [_APPLICATION_FILE, str(path)]


def covers(services: dict[str, Any], shown: Iterable[Path]) -> dict[str, list[dict[str, Any]]]:
    """Empty folders over the ``shown`` ones in ``/tmp`` and shared memory, by service, wherever it has the test's.

    The kernel removes and renames no folder that is a mount to the process that tries it.
    """
    own = {name: {v["target"]: v for v in service.get("volumes") or ()} for name, service in services.items()}
    places = {name: [t for t, v in mounts.items() if (v.get("type"), v.get("source")) == ("volume", _TMP)]
              for name, mounts in own.items()}  # fmt: skip
    every = [target for targets in places.values() for target in targets]
    found = {}
    for name, service in services.items():
        at = {namespaces.SHARED[0]: every if service.get("volumes_from") else places[name]}
        targets = [str(Path(target, p.name)) for p in shown for target in at.get(p.parent, [str(p.parent)])]
        found[name] = [{"type": "tmpfs", "target": t, "read_only": True} for t in targets if t not in own[name]]
    return found


def replacing(services: dict[str, Any], application: set[str], own: dict[str, Any]) -> str:
    """A compose file over the application's in which nothing waits for services of DoDo; ``own`` is added."""
    lines = ["services:"]
    for name in sorted(application & services.keys()):
        after = services[name].get("depends_on") or {}
        left = {other: how for other, how in after.items() if other in application or other in (SANDBOX, FILES)}
        lines.append(f"  {json.dumps(name)}: {{depends_on: !override {json.dumps(left)}}}")
    lines += [f"  {json.dumps(name)}: {json.dumps(service)}" for name, service in own.get("services", {}).items()]
    lines += [f"{key}: {json.dumps(value)}" for key, value in own.items() if key != "services"]
    return "\n".join([*lines, ""])
