"""What the values of a compose file's keys may not be, in plain values with their variables filled in.

Each function is the ``check`` of rows in ``compose_keys``.
"""

import os
import posixpath
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

from dodo_dsl.application import host_access
from dodo_dsl.application.access import host_paths, limit_findings, secret_variables
from dodo_dsl.application.access.host_paths import ASK, INSIDE, HostPaths
from dodo_dsl.application.access.model import AccessFinding, Check, Look, Steps, at, items
from dodo_dsl.diagnostics import did_you_mean

Findings = Iterator[AccessFinding]
Values = Mapping[str, Any]
OWN_VOLUMES = ("tmp", "report")
"""The names of DoDo's own volumes in a test; an application's volumes of these names get others."""
RUNTIMES = ("nvidia", "runc", "runsc")
NETWORKS = ("", "default", "none")
_PROFILE = "give the service a profile, so that it starts with 'docker compose --profile' and not in a test"
_WITHOUT = "is left out of sil and dil tests, which have no hardware"
_CDI = "is a description of the host, which can mount anything"
_RULE_OF_CHARACTERS = re.compile(r"c [0-9*]+:[0-9*]+ [rwm]+")
_RESERVED = ("deploy", "resources", "reservations", "devices")
_MAKE = "make it a service of the application"
_DRIVERS = ("json-file", "local", "")
_SCHEMES = ("http://", "https://", "git://", "ssh://", "git@", "github.com/", "docker-image://", "service:", "target:")
_REGISTRIES = ("index.docker.io/", "docker.io/")
_BASES = ("python", "library/python", "debian", "library/debian")
"""What DoDo's images, and those of many others, are built on."""
_TMPFS_OPTIONS = re.compile(r"(size|mode|uid|gid|nr_inodes|nr_blocks)=[\w%]+|nosuid|nodev|noexec|rw|ro|noatime")
_BIND_OPTIONS = re.compile(r"r?bind|rw|ro|nosuid|nodev|noexec")
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]*")
_OPTIONS = "use a tmpfs (type: tmpfs), or a folder of the repository (o: bind)"


def one_of(key: str, allowed: Sequence[str], message: str, hint: str = "", null: str = "") -> Check:
    """The check of a word that may be empty; ``message`` names it as ``{}``, and whose it is as ``{of}``.

    A value that is not set is the word ``null``.
    """

    def check(written: Values, look: Look) -> Findings:
        value = written.get(key, "")
        word = null if value in (None, False) else str(value)
        if word and word not in allowed and not look.paths.is_open(word):
            yield AccessFinding((key,), message.format(word, of=look.name), hint or f"use one of {', '.join(allowed)}")

    return check


def namespaces(service: Values, look: Look) -> Findings:
    """Containers outside the application, the host's processes, and in a test's copy the host's network and memory."""
    for key in host_access.NAMESPACES:
        kind, name = host_access.reference(service.get(key))
        if kind == "container" and name not in look.containers:
            yield AccessFinding((key,), f"'{key}' joins the container '{name}', which is not part of the application")
        elif look.own_network and key != "pid" and service.get(key) in ("host", "bridge"):
            yield AccessFinding((key,), f"'{service[key]}' of '{look.name}' is not the test's own")
    if service.get("pid") == "host":
        yield AccessFinding(("pid",), "'pid: host' gives access to the processes of all tests", "remove it")


def api_socket(service: Values, look: Look) -> Findings:
    if host_access.is_true(service.get("use_api_socket", False)):
        yield AccessFinding(("use_api_socket",), "'use_api_socket' gives access to the Docker engine", _PROFILE)


def external_links(service: Values, look: Look) -> Findings:
    for steps, link in items(service, "external_links"):
        yield AccessFinding(steps, f"'{link}' is a container outside the application", _MAKE)


def volumes_from(service: Values, look: Look) -> Findings:
    for steps, entry in items(service, "volumes_from"):
        kind, name, _ = host_access.borrowed(entry)
        if kind == "container" and name not in look.containers:
            yield AccessFinding(steps, f"the container '{name}' is not part of the application", _MAKE)


def env_files(service: Values, look: Look) -> Findings:
    for steps, entry in items(service, "env_file"):
        path = entry.get("path") if isinstance(entry, dict) else entry
        if isinstance(path, str) and (problem := look.paths.file_problem(path)):
            yield AccessFinding((*steps, "path") if isinstance(entry, dict) else steps, problem, ASK)


def privileges(service: Values, look: Look) -> Findings:
    if host_access.is_true(service.get("privileged", False)):
        yield AccessFinding(("privileged",), f"'privileged' of '{look.name}' {_WITHOUT}", kind="privilege")


def privileged_build(build: Values, look: Look) -> Findings:
    if host_access.is_true(build.get("privileged", False)):
        message = f"'privileged' of the build of '{look.name}' {_WITHOUT}"
        yield AccessFinding(("privileged",), message, kind="privilege")


def capabilities(service: Values, look: Look) -> Findings:
    for steps, word in items(service, "cap_add"):
        if not host_access.is_harmless_capability(word):
            yield AccessFinding(steps, f"capability '{word}' of '{look.name}' {_WITHOUT}", kind="privilege")


def confinement(service: Values, look: Look) -> Findings:
    for steps, word in items(service, "security_opt"):
        if not host_access.is_confining(word):
            message = f"'{word}' of '{look.name}' is left out, the engine's own confinement stays"
            yield AccessFinding(steps, message, kind="left out")


def hooks(service: Values, look: Look) -> Findings:
    for key in ("pre_start", "post_start", "pre_stop"):
        for steps, hook in items(service, key):
            if isinstance(hook, dict) and host_access.is_true(hook.get("privileged", False)):
                message = f"a privileged '{key}' of '{look.name}' reaches the host"
                yield AccessFinding((*steps, "privileged"), message, "remove it")


def logging(service: Values, look: Look) -> Findings:
    """In a test's copy: logs that DoDo cannot read."""
    driver = str(at(service, ("logging", "driver")) or "")
    if look.compiled and driver not in _DRIVERS:
        yield AccessFinding(("logging", "driver"), f"DoDo cannot read logs of '{driver}'")


def devices(service: Values, look: Look) -> Findings:
    for item, word in items(service, "devices"):
        shown, steps = (word.get("source"), (*item, "source")) if isinstance(word, dict) else (word, item)
        source = host_paths.source(word)
        if link := look.paths.link(source):
            message = f"device '{shown}' is a symbolic link to '{link}', outside the repository"
            yield AccessFinding(steps, message, "name the device itself")
        elif "=" in source and not source.startswith("/"):
            yield AccessFinding(steps, f"device '{shown}' {_CDI}", "name a file below /dev")
        elif any(map(host_access.is_of_machine, (shown, *look.paths.names(source)))):
            yield AccessFinding(steps, f"device '{shown}' gives access to the host's disks or memory", "remove it")
        elif host_paths.holds_port(source, look.ports):
            yield _port(steps, f"device '{shown}' of '{look.name}'")
        else:
            yield AccessFinding(steps, f"device '{shown}' of '{look.name}' {_WITHOUT}", kind="hardware")


def device_rules(service: Values, look: Look) -> Findings:
    for steps, word in items(service, "device_cgroup_rules"):
        if host_paths.is_rule_for_port(word, look.ports):
            yield _port(steps, f"rule '{word}' of '{look.name}'")
        elif "$" in str(word) or _RULE_OF_CHARACTERS.fullmatch(str(word)):
            yield AccessFinding(steps, f"device '{word}' of '{look.name}' {_WITHOUT}", kind="hardware")
        else:
            message = f"the rule '{word}' gives access to the host's disks"
            yield AccessFinding(steps, message, "name character devices, for example c 81:* rw")


def processors(service: Values, look: Look) -> Findings:
    """Requests of graphics processors that ask for other devices."""
    for way in (("gpus",), _RESERVED):
        for steps, request in items(service, *way):
            driver = str(at(request, ("driver",)) or "")
            if driver.lower() not in ("", "nvidia", "amd") and "$" not in driver:
                message = f"the driver '{driver}' of a device of '{look.name}' {_CDI}"
                yield AccessFinding((*steps, "driver"), message, "use nvidia, or no driver")
            for below, word in items(request, "device_ids"):
                if "=" in str(word):
                    message = f"device '{word}' of '{look.name}' {_CDI}"
                    yield AccessFinding((*steps, *below), message, "use numbers, or UUIDs of GPUs")


def _port(steps: Steps, what: str) -> AccessFinding:
    return AccessFinding(steps, f"{what} {host_paths.WHY}", host_paths.HINT, "port")


def mounts(service: Values, look: Look) -> Findings:
    """Mounts of the host, of its hardware, of rigs' ports, and of volumes that others use, too.

    A compiled test has none of the repository that can be written to.
    """
    for item, volume in items(service, "volumes"):
        found = host_access.mount(volume)
        words = [word for word in host_access.mount_options(volume) if word in ("shared", "rshared", "slave", "rslave")]
        for word in words:
            yield from (replace(f, steps=item) for f in propagation({"propagation": word}, look))
        steps = (*item, "source") if isinstance(volume, dict) and "source" in volume else item
        if host_access.is_bind(volume, found.source):
            yield from (f.below(*steps) for f in _bind(found, look))
        elif host_access.is_external(look.volumes.get(found.source)) and not found.read_only:
            hint = "mount it read-only (:ro), or remove 'external', so that compose creates it"
            yield AccessFinding(steps, f"volume '{found.source}' is external, so tests would share it", hint)


def _bind(found: host_access.Mount, look: Look) -> Findings:
    paths, source = look.paths, found.source
    if paths.is_open(source):
        return
    every = [host_access.Mount(path, found.target, found.read_only) for path in paths.names(source)]
    if "\0" in source:
        yield AccessFinding((), *paths.mount_problem(source))
    elif any(map(host_access.is_machine, every)):
        yield AccessFinding((), f"{_called(source, paths)} belongs to the host, so tests would share it", _PROFILE)
    elif any(host_access.is_of_machine(seen.source) for seen in every):
        message = f"{_called(source, paths)} gives access to the host's disks or memory"
        yield AccessFinding((), message, "remove it")
    elif any(host_paths.is_port(seen.source, look.ports) for seen in every):
        yield _port((), f"'{source}' of '{look.name}'")
    elif source.startswith(("/", "~")) and all(map(host_access.is_hardware, every)) and not paths.link(source):
        yield AccessFinding((), f"'{source}' of '{look.name}' {_WITHOUT}", kind="hardware")
    elif look.compiled or not host_access.is_token(found):
        problem, hint = paths.mount_problem(source)
        if look.compiled and not (problem or found.read_only or paths.is_writable(source)):
            problem = f"'{source}' is mounted to be written to"
        if problem:
            yield AccessFinding((), problem, hint)


def _called(source: str, paths: HostPaths) -> str:
    link = paths.link(source)
    return f"'{source}', a symbolic link to '{link}'," if link else f"'{source}'"


mount_type = one_of("type", ("bind", "volume", "tmpfs", "image"), "mounts of type '{}' cannot be isolated", null="null")
propagation = one_of(
    "propagation",
    ("private", "rprivate"),
    "propagation '{}' lets mounts in and out of the container",
    "remove it",
)
recursion = one_of(
    "recursive",
    ("enabled", "disabled", "readonly"),
    "'recursive: {}' lets the service write to what is mounted below a folder that it only reads",
    "remove it, or write readonly",
)
runtime = one_of(
    "runtime",
    RUNTIMES,
    "the runtime '{}' may not isolate the container",
    f"remove it, or use one of {', '.join(RUNTIMES)}",
)
build_network = one_of(
    "network", NETWORKS, "a build of '{of}' on the network '{}' reaches services of the host", "remove it"
)


def builds(service: Values, look: Look) -> Findings:
    """The names of DoDo's own images, and the folder of a build in its short form."""
    build, image = service.get("build"), str(service.get("image") or "")
    if build is None:
        return
    name = short_name(image)
    if name.startswith("dodo/") or name in _BASES:
        which = "one of DoDo's own" if name.startswith("dodo/") else "one on which others are built"
        message = f"the image '{image}' of '{look.name}' would replace {which}"
        yield AccessFinding(("build",), message, "give the image another name")
    if name in map(short_name, look.images):
        yield AccessFinding(("image",), f"the image '{image}' of '{look.name}' would replace one of DoDo's own")
    if isinstance(build, str):
        yield from (AccessFinding(("build",), f.message, f.hint) for f in context({"context": build}, look))


def short_name(image: str) -> str:
    """An image's name without tag, digest and the registry that the engine takes by default."""
    name = image.partition("@")[0]
    head, sign, tag = name.rpartition(":")
    name = head if sign and "/" not in tag else name
    for registry in _REGISTRIES:
        name = name.removeprefix(registry)
    return name


def is_remote(text: str, paths: HostPaths) -> bool:
    """Whether a context is elsewhere: of one that is a file of the repository, too, builders take that."""
    if not text.startswith(_SCHEMES) or ".." in text.split("/") or "\0" in text:
        return False
    return not any(os.path.lexists(place / text) for place in (paths.folder, *paths.roots))


def context(build: Values, look: Look) -> Findings:
    """The folder of a build, and its file there."""
    folder = build.get("context")
    folder = folder if isinstance(folder, str) and folder else "."
    if look.paths.is_open(folder) or is_remote(folder, look.paths):
        return
    if problem := _folder_problem(folder, look.paths):
        yield AccessFinding(("context",), problem, ASK)
        return
    file = build.get("dockerfile")
    if isinstance(file, str) and file and (problem := look.paths.file_problem(posixpath.join(folder, file), file)):
        yield AccessFinding(("dockerfile",), problem, ASK)


def _folder_problem(text: str, paths: HostPaths) -> str:
    if "://" in text:
        return f"'{text}' is of a kind that may be a file of the host"
    return paths.file_problem(text)


def other_contexts(build: Values, look: Look) -> Findings:
    for steps, text in _pairs(build, "additional_contexts"):
        is_elsewhere = look.paths.is_open(text) or is_remote(text, look.paths)
        if not is_elsewhere and (problem := _folder_problem(text, look.paths)):
            yield AccessFinding(steps, problem, ASK)


def keys_of_host(build: Values, look: Look) -> Findings:
    for steps, text in _pairs(build, "ssh"):
        if problem := look.paths.file_problem(text):
            yield AccessFinding(steps, problem, ASK)


def _pairs(written: Values, key: str) -> Iterator[tuple[Steps, str]]:
    """The values of a mapping, or of a list of ``name=value``, each with the steps to it, as far as there are."""
    value = written.get(key)
    found: list[tuple[Steps, str]]
    if isinstance(value, dict):
        found = [((key, str(name)), str(text or "")) for name, text in value.items()]
    else:
        found = [(steps, str(text).partition("=")[2]) for steps, text in items(written, key)]
    yield from ((steps, text) for steps, text in found if text)


def content(secret: Values, look: Look) -> Findings:
    """The file or the variable of a secret or config."""
    file, variable = secret.get("file"), secret.get("environment")
    if isinstance(file, str) and (problem := look.paths.file_problem(file)):
        yield AccessFinding(("file",), problem, ASK)
    if isinstance(variable, str) and secret_variables.is_of_pipeline(variable) and variable not in look.passed:
        message = f"{look.what} '{look.name}' is '{variable}', which belongs to the pipeline and not to the application"
        yield AccessFinding(("environment",), message, f"to allow it, write environment: [{variable}] in dodo.yml")


volume_driver = one_of(
    "driver",
    ("local",),
    "the driver '{}' of the volume '{of}' reaches beyond the test",
    "remove it, so that the engine makes its own volume",
)


def volume_name(volume: Values, look: Look) -> Findings:
    external = volume.get("external")
    called = str((external.get("name") if isinstance(external, dict) else volume.get("name")) or look.name)
    is_ours = host_access.is_external(volume) and called.startswith("dodo-")
    if "$" not in called and (is_ours or not _NAME.fullmatch(called)):
        yield AccessFinding(("name",), f"'{called}' is not a name that a volume of the application may have")


def volume_options(volume: Values, look: Look) -> Findings:
    """A tmpfs, or a folder that may be mounted; with other options the engine mounts disks and shares of networks.

    A compiled test has no folder that could be written to although dodo.yml does not name it.
    """
    options = volume.get("driver_opts")
    if options and not isinstance(options, dict):
        yield AccessFinding(("driver_opts",), f"'driver_opts' of the volume '{look.name}' is not a mapping", _OPTIONS)
    if isinstance(options, dict) and str(volume.get("driver") or "local") == "local":
        yield from (f.below("driver_opts") for f in _options(options, look))
    if look.name in OWN_VOLUMES and look.compiled:
        return
    yield from limit_findings.of_volume(volume, look)
    device = str(options.get("device") or "") if isinstance(options, dict) and host_access.is_bound(volume) else ""
    if look.compiled and device and not host_access.is_read_only(volume) and not look.paths.is_writable(device):
        yield AccessFinding(("driver_opts", "o"), f"'{device}' is mounted to be written to")


def _options(options: Values, look: Look) -> Findings:
    kind, flags, device = (str(options.get(key) or "") for key in ("type", "o", "device"))
    unknown = [key for key in options if key not in ("type", "o", "device")]
    for key in unknown:
        message = f"unknown option '{key}' of the volume '{look.name}'"
        yield AccessFinding((key,), message, did_you_mean(str(key), ("type", "o", "device")))
    words = [word.strip() for word in flags.split(",") if word.strip()]
    if unknown or not options or "$" in f"{kind}{flags}":
        return
    if {"bind", "rbind"} & set(words):
        if not all(_BIND_OPTIONS.fullmatch(word) for word in words):
            yield AccessFinding(("o",), f"'{flags}' of the volume '{look.name}' has other options than bind, ro and rw")
        problem, hint = _device_problem(device, look.paths)
        if problem:
            yield AccessFinding(("device",), problem, hint)
    elif kind != "tmpfs" or not all(_TMPFS_OPTIONS.fullmatch(word) for word in words):
        message = f"the volume '{look.name}' mounts '{kind or flags or device}', which reaches beyond the test"
        yield AccessFinding(("type",) if kind else ("o",) if flags else (), message, _OPTIONS)


def _device_problem(device: str, paths: HostPaths) -> tuple[str, str]:
    if paths.is_open(device):
        return "", ""
    if link := paths.link(device):
        return f"'{device}' is a symbolic link to '{link}', outside the repository", INSIDE
    for name in paths.names(device):
        seen = host_access.Mount(name, "", read_only=False)
        if host_access.is_machine(seen) or host_access.is_hardware(seen) or host_access.is_of_machine(name):
            return f"'{device}' belongs to the host, so tests would share it", "mount a folder of the repository"
    return paths.mount_problem(device)
