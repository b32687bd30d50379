"""Every key of the compose specification, and what becomes of it in a test's copy of a compose file.

A key without a row is unknown, and refused until somebody decides. The tests compare the tables with the
specification's schema, and docs/reference/compose-keys.md shows them.
"""

from typing import Literal

Treatment = Literal["kept", "rewritten", "removed", "refused"]
Rows = dict[str, tuple[Treatment, str]]

TOP: Rows = {
    "services": ("rewritten", "see the keys of a service"),
    "volumes": ("rewritten", "each test has its own"),
    "secrets": ("kept", "from files of the repository, and from variables that are passed"),
    "configs": ("kept", "from files of the repository, and from variables that are passed"),
    "networks": ("removed", "each test has a network of its own"),
    "include": ("rewritten", "DoDo merges the files itself"),
    "name": ("removed", "each test is a project of its own"),
    "version": ("removed", "compose ignores it"),
    "models": ("refused", "the engine's model runner is shared by all tests"),
    "jobs": ("refused", "a test starts services and no schedules"),
}

SERVICE: Rows = {
    "annotations": ("removed", "runtimes take settings of the host from them"),
    "attach": ("removed", "DoDo collects the output"),
    "blkio_config": ("kept", "limits"),
    "build": ("rewritten", "see the keys of 'build'"),
    "cap_add": ("rewritten", "keeps what stays within the container"),
    "cap_drop": ("rewritten", "with AUDIT_WRITE, MKNOD, NET_RAW, SETFCAP and SYS_CHROOT added"),
    "cgroup": ("removed", "each container has its own"),
    "cgroup_parent": ("removed", "it would evade the engine's limits"),
    "command": ("rewritten", "with the test's CID"),
    "configs": ("kept", "what the top-level 'configs' name"),
    "container_name": ("removed", "compose names the container"),
    "cpu_count": ("kept", "a limit"),
    "cpu_percent": ("kept", "a limit"),
    "cpu_period": ("kept", "a limit"),
    "cpu_quota": ("rewritten", "the processors of `sandbox` at most"),
    "cpu_rt_period": ("removed", "it would keep the processor from others"),
    "cpu_rt_runtime": ("removed", "it would keep the processor from others"),
    "cpu_shares": ("rewritten", "1024 at most, half as many as of DoDo's services"),
    "cpus": ("rewritten", "that of `sandbox` in dodo.yml at most"),
    "cpuset": ("kept", "a limit"),
    "credential_spec": ("refused", "it is a file of a Windows host"),
    "depends_on": ("rewritten", "waits for DoDo's services, too"),
    "deploy": ("rewritten", "keeps resources within the limits"),
    "develop": ("removed", "a test watches no files"),
    "device_cgroup_rules": ("rewritten", "character devices, in hil tests only, and no ports of rigs"),
    "devices": ("rewritten", "in hil tests only, and no disks, memory or ports of rigs"),
    "dns": ("kept", "a name server"),
    "dns_opt": ("kept", "options of the resolver"),
    "dns_search": ("kept", "options of the resolver"),
    "domainname": ("kept", "a name in the container"),
    "entrypoint": ("rewritten", "with the test's CID"),
    "env_file": ("rewritten", "files of the repository"),
    "environment": ("rewritten", "with the test's CID, and without variables of the host that are not passed"),
    "expose": ("kept", "documents a port"),
    "extends": ("rewritten", "DoDo merges the services itself"),
    "external_links": ("refused", "they name containers outside the application"),
    "extra_hosts": ("kept", "names of addresses"),
    "gpus": ("kept", "tests share graphics processors as they share the processor; no other devices (CDI)"),
    "group_add": ("kept", "groups in the container"),
    "healthcheck": ("rewritten", "with the test's CID"),
    "hostname": ("kept", "a name in the container"),
    "image": ("rewritten", "a pipeline can set another one"),
    "init": ("kept", "a process in the container"),
    "ipc": ("rewritten", "the test's own"),
    "isolation": ("removed", "it is for Windows"),
    "label_file": ("removed", "labels do nothing in a test"),
    "labels": ("removed", "programs of the host act on them"),
    "links": ("kept", "names of services"),
    "logging": ("rewritten", "keeps json-file and local; 100 MB without a max-size, `file-size` of `sandbox` at most"),
    "mac_address": ("removed", "the engine gives one"),
    "mem_limit": ("rewritten", "that of `sandbox` in dodo.yml at most"),
    "mem_reservation": ("removed", "a test has limits only"),
    "mem_swappiness": ("kept", "a limit"),
    "memswap_limit": ("rewritten", "twice the memory of `sandbox` at most"),
    "models": ("refused", "the engine's model runner is shared by all tests"),
    "network_mode": ("rewritten", "the test's own"),
    "networks": ("rewritten", "the test's own, with the aliases"),
    "oom_kill_disable": ("removed", "the limit of memory must hold"),
    "oom_score_adj": ("removed", "it would let the kernel end others first"),
    "pid": ("rewritten", "other services' only"),
    "pids_limit": ("rewritten", "that of `sandbox` in dodo.yml at most"),
    "platform": ("kept", "which image is pulled"),
    "ports": ("removed", "tests publish none"),
    "post_start": ("removed", "DoDo runs no hooks"),
    "pre_start": ("removed", "DoDo runs no hooks"),
    "pre_stop": ("removed", "DoDo runs no hooks"),
    "privileged": ("rewritten", "in hil tests only, where the rig allows it"),
    "profiles": ("removed", "a service with a profile does not start"),
    "provider": ("refused", "it starts a program on the host"),
    "pull_policy": ("removed", "DoDo manages images"),
    "pull_refresh_after": ("removed", "DoDo manages images"),
    "read_only": ("kept", "less access"),
    "restart": ("removed", "containers are not restarted"),
    "runtime": ("kept", "nvidia, runc and runsc only"),
    "scale": ("removed", "each service runs once"),
    "secrets": ("kept", "what the top-level 'secrets' name"),
    "security_opt": ("rewritten", "no-new-privileges added"),
    "shm_size": ("rewritten", "the memory of `sandbox` at most; under network isolation it is the test's own"),
    "stdin_open": ("kept", "nobody types"),
    "stop_grace_period": ("kept", "DoDo waits 2 s"),
    "stop_signal": ("kept", "a signal to the container"),
    "storage_opt": ("kept", "a limit"),
    "sysctls": ("kept", "the engine allows those of the container's namespaces only"),
    "tmpfs": ("rewritten", "the memory of `sandbox` at most"),
    "tty": ("kept", "a terminal in the container"),
    "ulimits": ("rewritten", "those of `sandbox` at most, and no core dumps"),
    "umask": ("kept", "permissions of new files in the container"),
    "use_api_socket": ("refused", "it gives access to the Docker engine"),
    "user": ("kept", "a user in the container"),
    "userns_mode": ("removed", "the engine's own"),
    "uts": ("removed", "the container's own"),
    "volumes": ("rewritten", "see the keys of a mount"),
    "volumes_from": ("rewritten", "of the application's services"),
    "working_dir": ("kept", "a folder in the container"),
}

BUILD: Rows = {
    "additional_contexts": ("rewritten", "folders of the repository, images and URLs"),
    "args": ("kept", "without variables of the host that are not passed"),
    "cache_from": ("removed", "the engine has its own cache"),
    "cache_to": ("removed", "it would write to the host or to a registry"),
    "context": ("rewritten", "a folder of the repository, or a URL"),
    "dockerfile": ("kept", "a file of the repository"),
    "dockerfile_inline": ("kept", "a file"),
    "entitlements": ("refused", "a build with them reaches the host"),
    "extra_hosts": ("kept", "names of addresses"),
    "isolation": ("removed", "it is for Windows"),
    "labels": ("removed", "programs of the host act on them"),
    "network": ("kept", "default and none only"),
    "no_cache": ("kept", "builds anew"),
    "no_cache_filter": ("kept", "builds stages anew"),
    "platforms": ("kept", "which image is built"),
    "privileged": ("rewritten", "in hil tests only, where the rig allows it"),
    "provenance": ("kept", "what is said of the image"),
    "pull": ("kept", "which base images are pulled"),
    "sbom": ("kept", "what is said of the image"),
    "secrets": ("kept", "what the top-level 'secrets' name"),
    "shm_size": ("rewritten", "the memory of `sandbox` at most"),
    "ssh": ("removed", "no build gets keys of the host"),
    "tags": ("removed", "they could replace other tests' images"),
    "target": ("kept", "a stage of the file"),
    "ulimits": ("rewritten", "those of `sandbox` at most, and no core dumps"),
}

MOUNT: Rows = {
    "bind": ("rewritten", "without propagation"),
    "consistency": ("kept", "Linux ignores it"),
    "image": ("kept", "a folder of an image"),
    "read_only": ("kept", "less access"),
    "source": ("rewritten", "of the repository, to be read or as a copy; see docs/reference/applications.md"),
    "target": ("kept", "a path in the container"),
    "tmpfs": ("rewritten", "the memory of `sandbox` at most"),
    "type": ("kept", "bind, volume, tmpfs and image only"),
    "volume": ("rewritten", "see the options of a volume"),
}

DEPLOY: Rows = {
    "endpoint_mode": ("removed", "each test has a network of its own"),
    "labels": ("removed", "programs of the host act on them"),
    "mode": ("removed", "each service runs once"),
    "placement": ("removed", "a test runs on one machine"),
    "replicas": ("removed", "each service runs once"),
    "resources": ("rewritten", "within the limits"),
    "restart_policy": ("removed", "containers are not restarted"),
    "rollback_config": ("removed", "each service runs once"),
    "update_config": ("removed", "each service runs once"),
}

RESERVATIONS: Rows = {
    "cpus": ("kept", "compose ignores it"),
    "devices": ("kept", "graphics processors; no other devices (CDI)"),
    "generic_resources": ("removed", "they are for a swarm"),
    "memory": ("removed", "a test has limits only"),
}

MOUNTED_VOLUME: Rows = {
    "labels": ("removed", "programs of the host act on them"),
    "nocopy": ("kept", "what an image has there"),
    "subpath": ("kept", "a folder of the volume"),
}

VOLUME: Rows = {
    "driver": ("kept", "local only"),
    "driver_opts": ("rewritten", "tmpfs, or a folder: of the repository as a copy, or one that dodo.yml names"),
    "external": ("kept", "where services mount it read-only"),
    "labels": ("removed", "programs of the host act on them"),
    "name": ("removed", "each test has its own"),
}

NETWORK: Rows = {
    "attachable": ("removed", "each test has a network of its own"),
    "driver": ("removed", "each test has a network of its own"),
    "driver_opts": ("removed", "each test has a network of its own"),
    "enable_ipv4": ("removed", "each test has a network of its own"),
    "enable_ipv6": ("removed", "each test has a network of its own"),
    "external": ("removed", "each test has a network of its own"),
    "internal": ("removed", "a test's network has no way out unless dodo.yml allows it"),
    "ipam": ("removed", "each test has a network of its own"),
    "labels": ("removed", "each test has a network of its own"),
    "name": ("removed", "each test has a network of its own"),
}

SECRET: Rows = {
    "driver": ("refused", "a program of the engine would provide it"),
    "driver_opts": ("refused", "a program of the engine would provide it"),
    "environment": ("kept", "variables that are passed"),
    "external": ("refused", "the engine's secrets are not the application's"),
    "file": ("rewritten", "a file of the repository"),
    "labels": ("kept", "they do nothing in a test"),
    "name": ("removed", "compose names it"),
    "template_driver": ("refused", "a program of the engine would provide it"),
}

CONFIG: Rows = {
    "content": ("kept", "a text"),
    **{key: SECRET[key] for key in ("environment", "external", "file", "labels", "name", "template_driver")},
}

BELOW: dict[str, Rows] = {
    "build": BUILD,
    "deploy": DEPLOY,
    "deploy.resources.reservations": RESERVATIONS,
    "volumes.*": MOUNT,
    "volumes.*.volume": MOUNTED_VOLUME,
}
"""The tables of mappings below a service, by their paths; ``*`` is an item of a list."""

TABLES = {
    "the whole file": TOP,
    "a service": SERVICE,
    "`build`": BUILD,
    "`deploy`": DEPLOY,
    "`deploy.resources.reservations`": RESERVATIONS,
    "a mount (`volumes` of a service)": MOUNT,
    "options of a volume (`volume` of a mount)": MOUNTED_VOLUME,
    "a volume": VOLUME,
    "a network": NETWORK,
    "a secret": SECRET,
    "a config": CONFIG,
}


def removed(rows: Rows) -> dict[str, str]:
    """The keys that a copy does not have, with the reasons."""
    return {key: why for key, (treatment, why) in rows.items() if treatment == "removed"}
