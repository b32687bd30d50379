"""``docker compose`` for the application of a compiled test alone."""

import json
from pathlib import Path
from typing import Any

from dodo_dsl.application import compose_paths
from dodo_dsl.application.model import FILES, SANDBOX
from dodo_dsl.run.docker.compose import Compose
from dodo_dsl.run.mixed.holder import copier, holder

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

    def _files(self, folder: Path) -> list[str]:
        path = folder / "mixed.compose.yml"
        path.write_text(self._replacing, encoding="utf-8")
        return [_APPLICATION_FILE, str(path)]


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
