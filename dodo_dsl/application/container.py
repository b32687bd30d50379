"""A service of the application as a container of a test, constructed from the keys that a test carries.

Each key has one function, which gives what the container has for it. All other keys are left out, and one warning names
them; those without which something else would run are refused.
"""

import re
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from dodo_dsl import source
from dodo_dsl.application import limits, opendlv_flags
from dodo_dsl.application.interpolation import escaped
from dodo_dsl.application.merge import NAMESPACES, filled_node, is_local
from dodo_dsl.application.model import (
    FILES,
    OFFSCREEN,
    SANDBOX,
    ComposeService,
    environment,
    image_variable,
    plain,
    text,
)
from dodo_dsl.application.mounts import mounts
from dodo_dsl.application.part import OFF, Part, is_set
from dodo_dsl.application.variables import variables_with_cid
from dodo_dsl.diagnostics import Diagnostic, Span, did_you_mean, listed
from dodo_dsl.source import Node, Scalar

if TYPE_CHECKING:
    from dodo_dsl.application.construction import Construction

TOP_LEFT_OUT = ("jobs", "models", "name", "networks", "version")
Key = Callable[["Container", Node], Any]


def is_carried(key: str) -> bool:
    return key in _CARRIED


class Container(Part):
    def __init__(self, project: "Construction", service: ComposeService) -> None:
        super().__init__(project, service.name, service.span, [])
        self.service = service
        self.own: dict[str, Any] = {}
        variables = dict(project.setting.given)
        cids = dict.fromkeys(opendlv_flags.CID_VARIABLES, str(project.setting.cid))
        self.known = {**project.application.known, **variables, **cids}
        node = service.node.get("volumes")
        self.mounts = mounts(self, node) if node else []

    def made(self) -> dict[str, Any]:
        for key, entry in self.service.node.entries.items():
            if key in _CARRIED:
                value = _CARRIED[key](self, entry.value) if is_set(entry.value) else None
                self.own.update({} if value is None else {key: value})
            elif key in _REFUSED:
                self.is_refused(key, entry, f"'{self.name}'", (_REFUSED[key], _WITHOUT))
            elif key in _LEFT_OUT:
                self.left += [(key, entry.key)] if plain(entry.value) not in OFF else []
            elif key != "profiles":
                self.unknown_key(key, self.service.node, f"'{self.name}'", (*_CARRIED, *_REFUSED, *_LEFT_OUT))
        for step in (_own_environment, limits.own_limits, _own_namespaces, _own_dependencies):
            step(self)
        if self.left:
            keys = list(dict.fromkeys(key for key, _ in self.left))
            are = "is" if len(keys) == 1 else "are"
            message = f"{listed([f'{key!r}' for key in keys])} of '{self.name}' {are} left out: a test does not carry "
            message += "this key" if len(keys) == 1 else "these keys"
            self.add(Diagnostic(self.left[0][1], "application-key", message, severity="warning"))
        return self.own

    def filled(self, key: str) -> Any:
        node = self.service.raw.get(key)
        return None if node is None else plain(filled_node(node, self.known, self.project.application.is_late))

    def other(self, key: str, name: str, span: Span) -> str:
        """A service that a key names, if it starts; a problem if there is none, as of a container of others."""
        others = self.project.application.services
        if name.startswith("container:"):
            message = f"'{key}' joins the {name.replace(':', ' ', 1)}, which is not part of the application"
            self.refuse(span, message, "make it a service of the application")
        elif name not in others and name not in self.project.application.dropped:
            message = f"'{key}' of '{self.name}' names the unknown service '{name}'"
            self.bad(span, message, did_you_mean(name, others))
        return name if name in others else ""


_REMOTE = ("http://", "https://", "git://", "ssh://", "git@", "github.com/", "docker-image://", "service:", "target:")
_AROUND_NAME = re.compile(r"^(index\.)?docker\.io/|:[^/:@]*(@.*)?\Z|@.*\Z", re.DOTALL)
"""The registry that the engine takes by default, tag and digest."""
_BASES = ("python", "library/python", "debian", "library/debian")
"""What DoDo's images, and those of many others, are built on."""
_RUNTIMES = ("nvidia", "runc", "runsc")
_CONDITIONS = ("service_started", "service_healthy", "service_completed_successfully")
_WITHOUT = "leave the service out: application: {without: [...]} in dodo.yml; or give it a profile"


def _command(c: Container, key: str, node: Node) -> Any:
    if isinstance(node, Scalar) and isinstance(node.value, str):
        try:
            opendlv_flags.split(node.value)
        except ValueError as error:
            c.bad(node.span, f"'{key}' of '{c.name}': {error}")
    value = c.filled(key)
    return with_cid(value, c.project.setting.cid) if value is not None else None


def with_cid(command: Any, cid: int) -> Any:
    """A command with its CID, a string staying a string, which compose splits."""
    if isinstance(command, str):
        return opendlv_flags.with_cid_text(command, cid)
    return list(opendlv_flags.with_cid([text(word) for word in command], cid))


def _healthcheck(c: Container, node: Node) -> Any:
    made = c.filled("healthcheck") or {}
    known = "disable interval retries test timeout start_period start_interval"
    c.fields(node, f"'healthcheck' of '{c.name}'", known)
    if made.get("test") is not None:
        made["test"] = with_cid(made["test"], c.project.setting.cid)
    return {key: value for key, value in made.items() if key in known.split() and value is not None}


def _env_file(c: Container, node: Node) -> Any:
    made: list[Any] = []
    for item in c.items(node):
        c.fields(item, f"'env_file' of '{c.name}'", "path required format")
    for file in c.service.env_files:
        if path := c.path(file.path, file.span):
            c.problems.extend(file.problems)
            if file.required and not (c.project.application.folder / file.path).is_file():
                hint = "create it, or write {path: ..., required: false}; paths are relative to this file"
                c.bad(file.span, f"there is no file '{file.path}'", hint)
            about = {**({} if file.required else {"required": False}), **({"format": "raw"} if file.raw else {})}
            made.append({"path": path, **about} if about else path)
    return made


def _own_environment(c: Container) -> None:
    application, setting = c.project.application, c.project.setting
    made = variables_with_cid(c.service, c.known, application.is_late, dict(setting.given), setting.cid)
    written = c.service.node.get("environment")
    names_it = written is not None and "DISPLAY" in environment(plain(written))
    if names_it and not made.keys() & OFFSCREEN.keys() and not application.is_late("DISPLAY"):
        made |= OFFSCREEN
    if made:
        c.own["environment"] = made


def _namespace(c: Container, key: str, node: Node) -> Any:
    word = c.literal(node) or ""
    if word.startswith(("service:", "container:")):
        found = c.other(key, word.removeprefix("service:"), node.span)
        return f"service:{found}" if found else None
    if key == "pid" and word == "host":
        c.refuse(node.span, "'pid: host' gives access to the processes of all tests", "remove it")
    return word if (key, word) == ("network_mode", "none") else None


def _volumes_from(c: Container, node: Node) -> Any:
    made = []
    for item in c.items(node):
        text = (c.literal(item) or "").removeprefix("service:")
        name, sign, options = (text, "", "") if text.startswith("container:") else text.partition(":")
        if name and (found := c.other("volumes_from", name, item.span)):
            made.append(escaped(found + sign + options))
    return made or None


def _networks(c: Container, node: Node) -> Any:
    """The names that the service has in networks, which are the test's one."""
    aliases = [plain(a) for e in source.entries(node).values() if (a := source.part(e.value, "aliases"))]
    names = list(dict.fromkeys(str(name) for each in aliases for name in each or ()))
    return {"default": {"aliases": names}} if names else None


def _links(c: Container, node: Node) -> Any:
    found = [(link, item.span) for item in c.items(node) if (link := plain(item))]
    return [link for link, span in found if c.other("links", str(link).partition(":")[0], span)] or None


def _depends_on(c: Container, node: Node) -> Any:
    made, services = {}, source.entries(node)
    for name, entry in services.items():
        about = source.entries(entry.value)  # nothing of a test is restarted
        found = {key: plain(about[key].value) for key in ("condition", "required") if key in about}
        own = {key: value for key, value in found.items() if value is not None}
        condition = own.get("condition", _CONDITIONS[0])
        if condition not in _CONDITIONS:
            message = f"'{condition}' is not a condition of 'depends_on'"
            c.bad(about["condition"].value.span, message, f"known: {', '.join(_CONDITIONS)}")
        if own.get("required") is False:
            is_there = name in c.project.application.services
        else:
            is_there = bool(c.other("depends_on", name, entry.key))
        made.update({name: own or {"condition": _CONDITIONS[0]}} if is_there else {})
    return made


def _secrets(c: Container, node: Node, key: str) -> Any:
    known = source.entries(c.project.application.rest.get(key))
    for item in c.items(node):
        fields = c.fields(item, f"a {key[:-1]} of '{c.name}'", "source target uid gid mode")
        word = fields.get("source") if isinstance(item, source.Mapping) else item
        if isinstance(word, Scalar) and word.text not in known:
            message = f"'{c.name}' takes the {key[:-1]} '{word.text}', which the top-level '{key}' do not declare"
            c.bad(word.span, message, did_you_mean(word.text, known))
    return plain(node)


def _runtime(c: Container, node: Node) -> Any:
    word = c.literal(node)
    if word not in (*_RUNTIMES, "", None):
        message = f"the runtime '{word}' may not isolate the container"
        c.refuse(node.span, message, f"remove it, or use one of {', '.join(_RUNTIMES)}")
    return word if word in _RUNTIMES else None


def _security(c: Container, node: Node) -> Any:
    """Options of the engine's confinement: all on a rig that allows them, else those of ``no-new-privileges``."""
    words = [word for item in c.items(node) if (word := c.literal(item))]
    is_kept = c.project.setting.keeps_privileges
    made = [escaped(word) for word in words if is_kept or word.startswith("no-new-privileges")]
    if len(made) < len(words):
        c.left.append(("security_opt", c.service.node.entries["security_opt"].key))
    return made or None


def _volumes(c: Container) -> Any:
    settled = map(c.project.settled, c.mounts)
    return list({(mount.source, mount.target): mount.written() for mount in settled}.values()) or None


def _image(c: Container, node: Node) -> Any:
    return f"${{{image_variable(c.name)}:-{text(plain(node))}}}"


def _build(c: Container, node: Node) -> Any:
    image, paths = c.service.node.get("image"), c.project.paths
    name = _AROUND_NAME.sub("", text(plain(image))) if image is not None else ""
    if name.startswith("dodo/") or name in _BASES:
        which = "one of DoDo's own" if name.startswith("dodo/") else "one on which others are built"
        c.refuse(node.span, f"the image '{name}' of '{c.name}' would replace {which}", "give the image another name")
    if image is None:
        c.own["image"] = f"${{{image_variable(c.name)}:-}}"
    fields = c.fields(
        node, f"the build of '{c.name}'",
        "context dockerfile dockerfile_inline args target additional_contexts secrets",
        "cache_from cache_to entitlements extra_hosts isolation labels no_cache no_cache_filter platforms privileged"
        " provenance pull sbom shm_size ssh tags ulimits",
        {"network": ("reaches services of the host", "remove it", "default", "none")},
    )  # fmt: skip
    made: dict[str, Any] = {
        key: plain(fields[key]) for key in ("dockerfile_inline", "target", "secrets", "network") if key in fields
    }
    if (context := c.literal(fields["context"]) if "context" in fields else ".") is not None:
        span = fields["context"].span if "context" in fields else node.span
        made = {"context": _context(c, span, context), **made}
        if is_local(context) and paths.is_own(context) and not (paths.folder / context).is_dir():
            hint = "create it, or remove 'build'; paths are relative to this file"
            message = f"there is no folder '{context}'"  # a warning, as an image or a variable for it may stand in
            c.add(Diagnostic(span, "application-file", message, hint, "warning"))
        if "dockerfile" in fields and (file := c.literal(fields["dockerfile"])):
            if not context.startswith(_REMOTE):
                c.path(file, fields["dockerfile"].span, base=context)
            made["dockerfile"] = escaped(file)
    if "args" in fields:
        made["args"] = _arguments(c, plain(fields["args"]))
    others = source.entries(fields.get("additional_contexts"))
    if found := {name: _context(c, e.value.span, word) for name, e in others.items() if (word := c.literal(e.value))}:
        made["additional_contexts"] = found
    return made


def _context(c: Container, span: Span, context: str) -> str:
    paths = c.project.paths
    is_here = any((place / context).exists() for place in (paths.folder, *paths.roots)) if "\0" not in context else True
    if context.startswith(_REMOTE) and ".." not in context.split("/") and not is_here:
        return escaped(context)
    if "://" in context:
        c.refuse(span, f"'{context}' is of a kind that may be a file of the host", "keep it in the repository")
        return ""
    return c.path(context, span) or ""


def _arguments(c: Container, written: Any) -> dict[str, str | None]:
    """Arguments of a build; those without a value have that of the variable of their name, or are left out."""
    application = c.project.application
    made: dict[str, str | None] = {}
    for name, value in environment(written).items():
        if value is not None or application.is_late(name):
            made[name] = value
        elif name in application.known:
            made[name] = application.known[name].replace("$", "$$")
    return made


def _own_namespaces(c: Container) -> None:
    """Network and IPC of the test, unless the service has those of another one, or none."""
    own, setting = c.own, c.project.setting
    mode = own.get("network_mode")
    if setting.own_network:
        own["ipc"] = f"service:{SANDBOX}"
    else:
        own["network_mode"] = mode or "host"
        ipc = c.literal(node) if (node := c.service.node.get("ipc")) is not None else None
        own.update({"ipc": ipc} if "ipc" not in own and ipc in ("host", "none", "private", "shareable") else {})
    if mode or not setting.own_network:
        own.pop("networks", None)
    if own.get("network_mode") == "host":
        own.pop("links", None)


def _own_dependencies(c: Container) -> None:
    """What starts before: also DoDo's services that must be ready first."""
    setting = c.project.setting
    started, healthy = {"condition": "service_started"}, {"condition": "service_healthy"}
    waits: dict[str, Any] = {SANDBOX: dict(started)} if setting.own_network else {}
    waits |= {name: dict(healthy) for name in setting.waits}
    if any(_source(volume) in c.project.copies for volume in c.own.get("volumes") or ()):
        waits = {FILES: dict(healthy), **waits}
    after = {**(c.own.pop("depends_on", None) or {}), **waits}
    c.own.update({"depends_on": after} if after else {})


def _source(volume: Any) -> str:
    return str(volume.get("source", "")) if isinstance(volume, dict) else str(volume).partition(":")[0]


_AS_WRITTEN = (
    "cap_drop", "cpuset", "dns", "dns_opt", "dns_search", "domainname", "expose", "extra_hosts", "group_add",
    "hostname", "init", "platform", "read_only", "stdin_open", "stop_grace_period", "stop_signal", "tty", "umask",
    "user", "working_dir",
)  # fmt: skip
_CARRIED: dict[str, Key] = {
    **dict.fromkeys(_AS_WRITTEN, lambda _, n: plain(n)),
    **limits.LIMITS,
    "build": _build,
    "cap_add": limits.capabilities,
    "command": lambda c, n: _command(c, "command", n),
    "configs": lambda c, n: _secrets(c, n, "configs"),
    "depends_on": _depends_on,
    "deploy": limits.deploy,
    "devices": limits.devices,
    "entrypoint": lambda c, n: _command(c, "entrypoint", n),
    "env_file": _env_file,
    "environment": lambda c, _: None,
    "gpus": limits.gpus,
    "healthcheck": _healthcheck,
    "image": _image,
    "links": _links,
    "networks": _networks,
    "privileged": limits.privileged,
    "runtime": _runtime,
    "secrets": lambda c, n: _secrets(c, n, "secrets"),
    "security_opt": _security,
    "tmpfs": limits.tmpfs,
    "ulimits": limits.ulimits,
    "volumes_from": _volumes_from,
    "volumes": lambda c, _: _volumes(c),
    **{key: lambda c, n, key=key: _namespace(c, key, n) for key in NAMESPACES},  # type: ignore[misc]
}
"""What the container has for a key, by the key; None for nothing."""
_REFUSED = {
    "credential_spec": "is a file of a Windows host",
    "external_links": "names containers outside the application",
    "models": "uses the engine's model runner, which all tests share",
    "provider": "starts a program on the host",
    "use_api_socket": "gives access to the Docker engine",
}
_LEFT_OUT = (
    "annotations", "attach", "blkio_config", "cgroup", "cgroup_parent", "container_name", "cpu_count", "cpu_percent",
    "cpu_period", "cpu_quota", "cpu_rt_period", "cpu_rt_runtime", "cpu_shares", "develop", "device_cgroup_rules",
    "isolation", "label_file", "labels", "logging", "mac_address", "mem_reservation", "mem_swappiness",
    "memswap_limit", "oom_kill_disable", "oom_score_adj", "ports", "post_start", "pre_start", "pre_stop",
    "pull_policy", "pull_refresh_after", "restart", "scale", "storage_opt", "sysctls", "userns_mode", "uts",
)  # fmt: skip
"""Keys of the compose specification that a test has no use for."""
