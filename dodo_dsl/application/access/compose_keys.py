"""Every key of the compose specification: what becomes of it in a test's copy of a compose file, and what judges it.

A key without a row is unknown, and refused until somebody decides. The tables drive the check when a test is compiled,
the copy, and the second look at the copy before anything is created. The tests compare them with the specification's
schema, and docs/reference/compose-keys.md shows them.
"""

from dodo_dsl.application.access import limit_findings as limits
from dodo_dsl.application.access import value_findings as values
from dodo_dsl.application.access.model import KeyRow, Rows


def _table(rows: dict[str, KeyRow]) -> dict[str, KeyRow]:
    """A row for each of the keys, which are words of one text if they have the same row."""
    return {key: row for keys, row in rows.items() for key in keys.split()}


TOP = _table(
    {
        "services": KeyRow("rewritten", "see the keys of a service"),
        "volumes": KeyRow("rewritten", "each test has its own"),
        "secrets configs": KeyRow("kept", "from files of the repository, and from variables that are passed"),
        "networks": KeyRow("removed", "each test has its own network"),
        "include": KeyRow("rewritten", "DoDo merges the files itself"),
        "name": KeyRow("removed", "each test is its own project"),
        "version": KeyRow("removed", "compose ignores it"),
        "models": KeyRow("refused", "the engine's model runner is shared by all tests"),
        "jobs": KeyRow("refused", "a test starts services and no schedules"),
    }
)
SERVICE = _table(
    {
        "ipc network_mode": KeyRow("rewritten", "the test's own", values.namespaces),
        "pid": KeyRow("rewritten", "other services' only", values.namespaces),
        "use_api_socket": KeyRow("refused", "it gives access to the Docker engine", values.api_socket),
        "runtime": KeyRow("kept", "nvidia, runc and runsc only", values.runtime),
        "volumes": KeyRow("rewritten", "see the keys of a mount", values.mounts),
        "external_links": KeyRow("refused", "they name containers outside the application", values.external_links),
        "volumes_from": KeyRow("rewritten", "of the application's services", values.volumes_from),
        "env_file": KeyRow("rewritten", "files of the repository", values.env_files),
        "privileged": KeyRow("rewritten", "in hil tests only, where the rig allows it", values.privileges),
        "devices": KeyRow("rewritten", "in hil tests only, and no disks, memory or ports of rigs", values.devices),
        "gpus": KeyRow(
            "kept",
            "tests share graphics processors as they share the processor; no other devices (CDI)",
            values.processors,
        ),
        "device_cgroup_rules": KeyRow(
            "rewritten", "character devices, in hil tests only, and no ports of rigs", values.device_rules
        ),
        "cap_add": KeyRow("rewritten", "keeps what stays within the container", values.capabilities),
        "cpu_quota": KeyRow("rewritten", "the processors of `sandbox` at most", limits.of_service),
        "cpu_shares": KeyRow("rewritten", "1024 at most, half as many as of DoDo's services", limits.of_service),
        "cpus mem_limit pids_limit": KeyRow("rewritten", "that of `sandbox` in dodo.yml at most", limits.of_service),
        "memswap_limit": KeyRow("rewritten", "twice the memory of `sandbox` at most", limits.of_service),
        "shm_size": KeyRow(
            "rewritten",
            "the memory of `sandbox` at most; under network isolation it is the test's own",
            limits.of_service,
        ),
        "tmpfs": KeyRow("rewritten", "the memory of `sandbox` at most", limits.of_service),
        "ulimits": KeyRow("rewritten", "those of `sandbox` at most, and no core dumps", limits.of_service),
        "security_opt": KeyRow("rewritten", "no-new-privileges added", values.confinement),
        "pre_start post_start pre_stop": KeyRow("removed", "DoDo runs no hooks", values.hooks),
        "build": KeyRow("rewritten", "see the keys of 'build'", values.builds),
        "image": KeyRow("rewritten", "a pipeline can set another one", values.builds),
        "annotations": KeyRow("removed", "runtimes take settings of the host from them"),
        "attach": KeyRow("removed", "DoDo collects the output"),
        "blkio_config": KeyRow("kept", "limits"),
        "cap_drop": KeyRow("rewritten", "with AUDIT_WRITE, MKNOD, NET_RAW, SETFCAP and SYS_CHROOT added"),
        "cgroup": KeyRow("removed", "each container has its own"),
        "cgroup_parent": KeyRow("removed", "it would evade the engine's limits"),
        "command entrypoint healthcheck": KeyRow("rewritten", "with the test's CID"),
        "configs": KeyRow("kept", "what the top-level 'configs' name"),
        "container_name": KeyRow("removed", "compose names the container"),
        "cpu_count cpu_percent cpu_period cpuset mem_swappiness storage_opt": KeyRow("kept", "a limit"),
        "cpu_rt_period cpu_rt_runtime": KeyRow("removed", "it would keep the processor from others"),
        "credential_spec": KeyRow("refused", "it is a file of a Windows host"),
        "depends_on": KeyRow("rewritten", "waits for DoDo's services, too"),
        "deploy": KeyRow("rewritten", "keeps resources within the limits", limits.of_service),
        "develop": KeyRow("removed", "a test watches no files"),
        "dns": KeyRow("kept", "a name server"),
        "dns_opt dns_search": KeyRow("kept", "options of the resolver"),
        "domainname hostname": KeyRow("kept", "a name in the container"),
        "environment": KeyRow(
            "rewritten", "with the test's CID, and without variables of the host that are not passed"
        ),
        "expose": KeyRow("kept", "documents a port"),
        "extends": KeyRow("rewritten", "DoDo merges the services itself"),
        "extra_hosts": KeyRow("kept", "names of addresses"),
        "group_add": KeyRow("kept", "groups in the container"),
        "init": KeyRow("kept", "a process in the container"),
        "isolation": KeyRow("removed", "it is for Windows"),
        "label_file": KeyRow("removed", "labels do nothing in a test"),
        "labels": KeyRow("removed", "programs of the host act on them"),
        "links": KeyRow("kept", "names of services"),
        "logging": KeyRow(
            "rewritten",
            "keeps json-file and local; 100 MB without a max-size, `file-size` of `sandbox` at most",
            values.logging,
        ),
        "mac_address": KeyRow("removed", "the engine gives one"),
        "mem_reservation": KeyRow("removed", "a test has limits only"),
        "models": KeyRow("refused", "the engine's model runner is shared by all tests"),
        "networks": KeyRow("rewritten", "the test's own, with the aliases"),
        "oom_kill_disable": KeyRow("removed", "the limit of memory must hold"),
        "oom_score_adj": KeyRow("removed", "it would let the kernel end others first"),
        "platform": KeyRow("kept", "which image is pulled"),
        "ports": KeyRow("removed", "tests publish none"),
        "profiles": KeyRow("removed", "a service with a profile does not start"),
        "provider": KeyRow("refused", "it starts a program on the host"),
        "pull_policy pull_refresh_after": KeyRow("removed", "DoDo manages images"),
        "read_only": KeyRow("kept", "less access"),
        "restart": KeyRow("removed", "containers are not restarted"),
        "scale": KeyRow("removed", "each service runs once"),
        "secrets": KeyRow("kept", "what the top-level 'secrets' name"),
        "stdin_open": KeyRow("kept", "no keyboard is attached"),
        "stop_grace_period": KeyRow("kept", "DoDo waits 2 s"),
        "stop_signal": KeyRow("kept", "a signal to the container"),
        "sysctls": KeyRow("kept", "the engine allows those of the container's namespaces only"),
        "tty": KeyRow("kept", "a terminal in the container"),
        "umask": KeyRow("kept", "permissions of new files in the container"),
        "user": KeyRow("kept", "a user in the container"),
        "userns_mode": KeyRow("removed", "the engine's own"),
        "uts": KeyRow("removed", "the container's own"),
        "working_dir": KeyRow("kept", "a folder in the container"),
    }
)
BUILD = _table(
    {
        "additional_contexts": KeyRow("rewritten", "folders of the repository, images and URLs", values.other_contexts),
        "args": KeyRow("kept", "without variables of the host that are not passed"),
        "cache_from": KeyRow("removed", "the engine has its own cache"),
        "cache_to": KeyRow("removed", "it would write to the host or to a registry"),
        "context": KeyRow("rewritten", "a folder of the repository, or a URL", values.context),
        "dockerfile": KeyRow("kept", "a file of the repository", values.context),
        "dockerfile_inline": KeyRow("kept", "a file"),
        "entitlements": KeyRow("refused", "a build with them reaches the host"),
        "extra_hosts": KeyRow("kept", "names of addresses"),
        "isolation": KeyRow("removed", "it is for Windows"),
        "labels": KeyRow("removed", "programs of the host act on them"),
        "network": KeyRow("kept", "default and none only", values.build_network),
        "no_cache": KeyRow("kept", "builds again"),
        "no_cache_filter": KeyRow("kept", "builds stages again"),
        "platforms": KeyRow("kept", "which image is built"),
        "privileged": KeyRow("rewritten", "in hil tests only, where the rig allows it", values.privileged_build),
        "provenance sbom": KeyRow("kept", "what is said of the image"),
        "pull": KeyRow("kept", "which base images are pulled"),
        "secrets": KeyRow("kept", "what the top-level 'secrets' name"),
        "shm_size": KeyRow("rewritten", "the memory of `sandbox` at most"),
        "ssh": KeyRow("removed", "no build gets keys of the host", values.keys_of_host),
        "tags": KeyRow("removed", "they could replace other tests' images"),
        "target": KeyRow("kept", "a stage of the file"),
        "ulimits": KeyRow("rewritten", "those of `sandbox` at most, and no core dumps"),
    }
)
MOUNT = _table(
    {
        "bind": KeyRow("rewritten", "see the options of a folder"),
        "consistency": KeyRow("kept", "Linux ignores it"),
        "image": KeyRow("kept", "a folder of an image"),
        "read_only": KeyRow("kept", "less access"),
        "source": KeyRow("rewritten", "of the repository, to be read or as a copy; see docs/reference/sandbox.md"),
        "target": KeyRow("kept", "a path in the container"),
        "tmpfs": KeyRow("rewritten", "the memory of `sandbox` at most"),
        "type": KeyRow("kept", "bind, volume, tmpfs and image only", values.mount_type),
        "volume": KeyRow("rewritten", "see the options of a volume"),
    }
)
BIND = _table(
    {
        "propagation": KeyRow("kept", "private and rprivate only", values.propagation),
        "recursive": KeyRow("kept", "enabled, disabled and readonly only", values.recursion),
        "create_host_path": KeyRow("kept", "a missing folder is made, or refused"),
        "selinux": KeyRow("kept", "a label of the folder"),
    }
)
MOUNTED_VOLUME = _table(
    {
        "labels": KeyRow("removed", "programs of the host act on them"),
        "nocopy": KeyRow("kept", "what an image has there"),
        "subpath": KeyRow("kept", "a folder of the volume"),
    }
)
DEPLOY = _table(
    {
        "endpoint_mode": KeyRow("removed", "each test has its own network"),
        "labels": KeyRow("removed", "programs of the host act on them"),
        "mode replicas rollback_config update_config": KeyRow("removed", "each service runs once"),
        "placement": KeyRow("removed", "a test runs on one machine"),
        "resources": KeyRow("rewritten", "within the limits"),
        "restart_policy": KeyRow("removed", "containers are not restarted"),
    }
)
RESERVATIONS = _table(
    {
        "cpus": KeyRow("kept", "compose ignores it"),
        "devices": KeyRow("kept", "graphics processors; no other devices (CDI)"),
        "generic_resources": KeyRow("removed", "they are for a swarm"),
        "memory": KeyRow("removed", "a test has limits only"),
    }
)
VOLUME = _table(
    {
        "driver": KeyRow("kept", "local only", values.volume_driver),
        "name": KeyRow("removed", "each test has its own", values.volume_name),
        "driver_opts": KeyRow(
            "rewritten",
            "tmpfs, or a folder: of the repository as a copy, or one that dodo.yml names",
            values.volume_options,
        ),
        "external": KeyRow("kept", "where services mount it read-only"),
        "labels": KeyRow("removed", "programs of the host act on them"),
    }
)
NETWORK = _table(
    {
        "attachable driver driver_opts enable_ipv4 enable_ipv6 external ipam labels name": KeyRow(
            "removed", "each test has its own network"
        ),
        "internal": KeyRow("removed", "a test's network has no way out unless dodo.yml allows it"),
    }
)
SECRET = _table(
    {
        "driver driver_opts template_driver": KeyRow("refused", "a program of the engine would provide it"),
        "environment": KeyRow("kept", "variables that are passed", values.content),
        "external": KeyRow("refused", "the engine's secrets are not the application's"),
        "file": KeyRow("rewritten", "a file of the repository", values.content),
        "labels": KeyRow("kept", "they do nothing in a test"),
        "name": KeyRow("removed", "compose names it"),
    }
)
CONFIG = {"content": KeyRow("kept", "a text")} | {
    key: row for key, row in SECRET.items() if not key.startswith("driver")
}
_NESTED = {
    "blkio_config": "device_read_bps device_read_iops device_write_bps device_write_iops weight weight_device",
    "blkio_config.device_read_bps.* blkio_config.device_read_iops.*": "path rate",
    "blkio_config.device_write_bps.* blkio_config.device_write_iops.*": "path rate",
    "blkio_config.weight_device.*": "path weight",
    "build.secrets.* configs.* secrets.*": "source target uid gid mode",
    "build.ulimits.* ulimits.*": "soft hard",
    "credential_spec": "config file registry",
    "depends_on.*": "condition restart required",
    "deploy.placement": "constraints preferences max_replicas_per_node",
    "deploy.placement.preferences.*": "spread",
    "deploy.resources": "limits reservations",
    "deploy.resources.limits": "cpus memory pids",
    "deploy.resources.reservations.devices.* gpus.*": "driver count device_ids capabilities options",
    "deploy.resources.reservations.generic_resources.*": "discrete_resource_spec",
    "deploy.resources.reservations.generic_resources.*.discrete_resource_spec": "kind value",
    "deploy.restart_policy": "condition delay max_attempts window",
    "deploy.rollback_config deploy.update_config": "parallelism delay failure_action monitor max_failure_ratio order",
    "devices.*": "source target permissions",
    "env_file.*": "path format required",
    "healthcheck": "disable interval retries test timeout start_period start_interval",
    "logging": "driver options",
    "networks.*": "aliases interface_name ipv4_address ipv6_address link_local_ips mac_address driver_opts priority"
    " gw_priority use_service_name_alias",
    "ports.*": "name mode host_ip target published protocol app_protocol",
    "volumes.*.image": "subpath",
    "volumes.*.tmpfs": "size mode",
}
"""Keys that are kept as they are, by the paths of their mappings in a service."""
BELOW: dict[str, Rows] = {
    **{path: _table({keys: KeyRow("kept", "")}) for paths, keys in _NESTED.items() for path in paths.split()},
    "build": BUILD,
    "deploy": DEPLOY,
    "deploy.resources.reservations": RESERVATIONS,
    "volumes.*": MOUNT,
    "volumes.*.bind": BIND,
    "volumes.*.volume": MOUNTED_VOLUME,
}
"""The tables of mappings below a service, by their paths; ``*`` is an item of a list, or a name."""
SHARED = {"volumes": VOLUME, "secrets": SECRET, "configs": CONFIG, "networks": NETWORK}
"""The tables of what the top-level keys name."""
TABLES = {
    "the whole file": TOP,
    "a service": SERVICE,
    "`build`": BUILD,
    "`deploy`": DEPLOY,
    "`deploy.resources.reservations`": RESERVATIONS,
    "a mount (`volumes` of a service)": MOUNT,
    "options of a folder (`bind` of a mount)": BIND,
    "options of a volume (`volume` of a mount)": MOUNTED_VOLUME,
    "a volume": VOLUME,
    "a network": NETWORK,
    "a secret": SECRET,
    "a config": CONFIG,
}


def removed(rows: Rows) -> dict[str, str]:
    """The keys that a copy does not have, with the reasons."""
    return {key: row.why for key, row in sorted(rows.items()) if row.treatment == "removed"}
