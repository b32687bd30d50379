"""The builds of an application's services, as far as they are checked: for whoever builds without running a test."""

from collections.abc import Mapping
from typing import Any

from dodo_dsl.application import compose_paths
from dodo_dsl.application.access import filled
from dodo_dsl.application.access.compose_keys import BUILD, removed
from dodo_dsl.application.access.limit_findings import service_excesses
from dodo_dsl.application.model import ApplicationSource, environment, plain
from dodo_dsl.plan.rewrite.container_limits import put

_LEFT_OUT = (*removed(BUILD), "privileged", "ssh")


def checked_builds(application: ApplicationSource) -> dict[str, Any]:
    """A compose file with the builds alone: whole paths, and every variable whose value is known filled in.

    ``application`` has no problems. What a build must not have is left out, as it is of a test.
    """
    base = str(application.folder)

    def change(path: str) -> str:
        return compose_paths.rebased(path, base)

    services = {}
    for name, service in application.services.items():
        build = plain(compose_paths.mapped_service(service.node, change)).get("build")
        if build is not None:
            own = {"build": build if isinstance(build, dict) else {"context": build}}
            own["build"] = {key: value for key, value in own["build"].items() if key not in _LEFT_OUT}
            if "args" in own["build"]:
                own["build"]["args"] = _with_values(own["build"]["args"], application.known)
            for excess in list(service_excesses(own, application.limits)):
                if excess.steps[0] == "build":
                    put(own, excess)
            services[name] = _literal(own, application)
    rest = compose_paths.mapped_rest(application.rest, change)
    secrets = {"secrets": _literal(plain(rest["secrets"]), application)} if "secrets" in rest else {}
    return {"services": services, **secrets}


def _with_values(arguments: Any, known: Mapping[str, str]) -> dict[str, Any]:
    """Arguments as a mapping; those without a value have that of the variable of their name, or are left out."""
    given = {name: known.get(name) if value is None else value for name, value in environment(arguments).items()}
    return {name: value for name, value in given.items() if value is not None}


def _literal(value: Any, application: ApplicationSource) -> Any:
    """A value with its variables filled in, which compose reads as it is."""
    if isinstance(value, dict):
        return {key: _literal(below, application) for key, below in value.items()}
    if isinstance(value, list):
        return [_literal(item, application) for item in value]
    if not isinstance(value, str) or "$" not in value:
        return value
    text = filled.text(value, application.known)
    return text if text == value else text.replace("$", "$$")
