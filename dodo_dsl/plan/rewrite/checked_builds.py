"""The builds of an application's services, as far as they are checked, for builds without a test."""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

from dodo_dsl.application import compose_paths
from dodo_dsl.application.access.compose_keys import BUILD, removed
from dodo_dsl.application.access.findings import service_findings, shared_findings
from dodo_dsl.application.access.host_paths import HostPaths
from dodo_dsl.application.access.limit_findings import put, service_limits
from dodo_dsl.application.access.model import Look, diagnostic
from dodo_dsl.application.access.value_findings import is_remote
from dodo_dsl.application.interpolation import EnvironmentProblem, changed_node, interpolate
from dodo_dsl.application.model import ApplicationSource, ComposeService, environment, plain
from dodo_dsl.diagnostics import Diagnostic, Span
from dodo_dsl.source import Entry
from dodo_dsl.source import Mapping as Node
from dodo_dsl.spec.sandbox_limits import SandboxLimits

_LEFT_OUT = (*removed(BUILD), "privileged", "ssh")


def checked_builds(application: ApplicationSource) -> tuple[dict[str, Any], list[Diagnostic]]:
    """A compose file with the builds alone, and what they may not have: whole paths, and no variables.

    Variables whose values are not known are empty: each builder has others in the environment. What a build must not
    have is left out, as it is of a test.
    """
    paths = replace(application.paths, literal=True)
    services: dict[str, Any] = {}
    found: list[Diagnostic] = []
    for name, service in application.services.items():
        node = Node(service.node.span, {k: e for k, e in service.node.entries.items() if k == "build"})
        try:
            written = _literal(node, application.known)
        except EnvironmentProblem as problem:
            found.append(Diagnostic(service.span, "application-file", f"the build of '{name}': {problem}", "set it"))
            continue
        own = plain(compose_paths.mapped_service(written, lambda path: _whole(path, paths)))
        if own.get("build") is not None:
            services[name] = _checked(own["build"], application.known, application.limits)
            found.extend(_problems(service, services[name], paths))
    secrets, problems = _secrets(application, paths)
    return compose_paths.escaped_values({"services": services, **secrets}), [*found, *problems]


def _literal(node: Node, known: Mapping[str, str]) -> Node:
    written = changed_node(node, lambda text: interpolate(text, known))
    assert isinstance(written, Node)
    return written


def _whole(path: str, paths: HostPaths) -> str:
    """A path from the root, so that it does not matter where the file with the builds is kept."""
    return path if "://" in path or is_remote(path, paths) else paths.whole(path)


def _checked(written: Any, known: Mapping[str, str], limits: SandboxLimits) -> dict[str, Any]:
    build = written if isinstance(written, dict) else {"context": written}
    build = {key: value for key, value in build.items() if key not in _LEFT_OUT and not key.startswith("x-")}
    if "args" in build:
        build["args"] = _with_values(build["args"], known)
    own = {"build": build}
    for finding in list(service_limits(own, limits)):
        put(own, finding)
    return own


def _with_values(arguments: Any, known: Mapping[str, str]) -> dict[str, Any]:
    """Arguments as a mapping; those without a value have that of the variable of their name, or are left out."""
    given = {name: known.get(name) if value is None else value for name, value in environment(arguments).items()}
    return {name: value for name, value in given.items() if value is not None}


def _problems(service: ComposeService, own: dict[str, Any], paths: HostPaths) -> Iterator[Diagnostic]:
    for finding in service_findings(service.name, own, Look(paths)):
        yield diagnostic(finding, service.node, service.span)


def _secrets(application: ApplicationSource, paths: HostPaths) -> tuple[dict[str, Any], list[Diagnostic]]:
    """The secrets from which builds may take theirs, and those that they may not have."""
    written = application.rest.get("secrets")
    if written is None:
        return {}, []
    node = Node(written.span, {"secrets": Entry(written.span, written)})
    try:
        entries = {key: entry.value for key, entry in _literal(node, application.known).entries.items()}
    except EnvironmentProblem as problem:
        place = Span(written.span.file, written.span.line)
        return {}, [Diagnostic(place, "application-file", f"the secrets: {problem}", "set it")]
    moved = compose_paths.mapped_rest(entries, lambda path: _whole(path, paths))
    secrets = {key: plain(value) for key, value in moved.items()}
    found = shared_findings(secrets, Look(paths, passed=application.access.passed))
    return secrets, [diagnostic(finding, node, written.span) for finding in found]
