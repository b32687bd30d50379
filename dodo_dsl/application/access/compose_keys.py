"""Every key of the compose specification: what becomes of it in a test's copy of a compose file, and what judges it.

A key without a row is unknown, and refused until somebody decides. The tables drive the check when a test is compiled,
the copy, and the second look at the copy before anything is created. The tests compare them with the specification's
schema, and docs/reference/compose-keys.md shows them.
"""

from dodo_dsl.application.access import limit_findings as limits
from dodo_dsl.application.access import value_findings as values
from dodo_dsl.application.access.model import Row, Rows


def _table(rows: dict[str, Row]) -> dict[str, Row]:
    """A row for each of the keys, which are words of one text where they have the same row."""
    return {key: row for keys, row in rows.items() for key in keys.split()}


TOP = _table(
    {
        "services": Row("rewritten", "see the keys of a service"),
        "volumes": Row("rewritten", "each test has its own"),
        "secrets configs": Row("kept", "from files of the repository, and from variables that are passed"),
        "networks": Row("removed", "each test has a network of its own"),
        "include": Row("rewritten", "DoDo merges the files itself"),
        "name": Row("removed", "each test is a project of its own"),
        "version": Row("removed", "compose ignores it"),
        "models": Row("refused", "the engine's model runner is shared by all tests"),
        "jobs": Row("refused", "a test starts services and no schedules"),
    }
)
SERVICE = _table(
    {
        "ipc network_mode": Row("rewritten", "the test's own", values.namespaces),
        "pid": Row("rewritten", "other services' only", values.namespaces),
        "use_api_socket": Row("refused", "it gives access to the Docker engine", values.api_socket),
        "runtime": Row("kept", "nvidia, runc and runsc only", values.runtime),
        "volumes": Row("rewritten", "see the keys of a mount", values.mounts),
        "external_links": Row("refused", "they name containers outside the application", values.external_links),
        "volumes_from": Row("rewritten", "of the application's services", values.volumes_from),
        "env_file": Row("rewritten", "files of the repository", values.env_files),
        "privileged": Row("rewritten", "in hil tests only, where the rig allows it", values.privileges),
        "devices": Row("rewritten", "in hil tests only, and no disks, memory or ports of rigs", values.devices),
        "gpus": Row(
            "kept",
            "tests share graphics processors as they share the processor; no other devices (CDI)",
            values.processors,
        ),
        "device_cgroup_rules": Row(
            "rewritten", "character devices, in hil tests only, and no ports of rigs", values.device_rules
        ),
        "cap_add": Row("rewritten", "keeps what stays within the container", values.capabilities),
        "cpu_quota": Row("rewritten", "the processors of `sandbox` at most", limits.of_service),
        "cpu_shares": Row("rewritten", "1024 at most, half as many as of DoDo's services", limits.of_service),
        "cpus mem_limit pids_limit": Row("rewritten", "that of `sandbox` in dodo.yml at most", limits.of_service),
        "memswap_limit": Row("rewritten", "twice the memory of `sandbox` at most", limits.of_service),
        "shm_size": Row(
            "rewritten",
            "the memory of `sandbox` at most; under network isolation it is the test's own",
            limits.of_service,
        ),
        "tmpfs": Row("rewritten", "the memory of `sandbox` at most", limits.of_service),
        "ulimits": Row("rewritten", "those of `sandbox` at most, and no core dumps", limits.of_service),
        "security_opt": Row("rewritten", "no-new-privileges added", values.confinement),
        "pre_start post_start pre_stop": Row("removed", "DoDo runs no hooks", values.hooks),
        "build": Row("rewritten", "see the keys of 'build'", values.builds),
        "image": Row("rewritten", "a pipeline can set another one", values.builds),
        "annotations": Row("removed", "runtimes take settings of the host from them"),
        "attach": Row("removed", "DoDo collects the output"),
        "blkio_config": Row("kept", "limits"),
        "cap_drop": Row("rewritten", "with AUDIT_WRITE, MKNOD, NET_RAW, SETFCAP and SYS_CHROOT added"),
        "cgroup": Row("removed", "each container has its own"),
        "cgroup_parent": Row("removed", "it would evade the engine's limits"),
        "command entrypoint healthcheck": Row("rewritten", "with the test's CID"),
        "configs": Row("kept", "what the top-level 'configs' name"),
        "container_name": Row("removed", "compose names the container"),
        "cpu_count cpu_percent cpu_period cpuset mem_swappiness storage_opt": Row("kept", "a limit"),
        "cpu_rt_period cpu_rt_runtime": Row("removed", "it would keep the processor from others"),
        "credential_spec": Row("refused", "it is a file of a Windows host"),
        "depends_on": Row("rewritten", "waits for DoDo's services, too"),
        "deploy": Row("rewritten", "keeps resources within the limits", limits.of_service),
        "develop": Row("removed", "a test watches no files"),
        "dns": Row("kept", "a name server"),
        "dns_opt dns_search": Row("kept", "options of the resolver"),
        "domainname hostname": Row("kept", "a name in the container"),
        "environment": Row("rewritten", "with the test's CID, and without variables of the host that are not passed"),
        "expose": Row("kept", "documents a port"),
        "extends": Row("rewritten", "DoDo merges the services itself"),
        "extra_hosts": Row("kept", "names of addresses"),
        "group_add": Row("kept", "groups in the container"),
        "init": Row("kept", "a process in the container"),
        "isolation": Row("removed", "it is for Windows"),
        "label_file": Row("removed", "labels do nothing in a test"),
        "labels": Row("removed", "programs of the host act on them"),
        "links": Row("kept", "names of services"),
        "logging": Row(
            "rewritten",
            "keeps json-file and local; 100 MB without a max-size, `file-size` of `sandbox` at most",
            values.logging,
        ),
        "mac_address": Row("removed", "the engine gives one"),
        "mem_reservation": Row("removed", "a test has limits only"),
        "models": Row("refused", "the engine's model runner is shared by all tests"),
        "networks": Row("rewritten", "the test's own, with the aliases"),
        "oom_kill_disable": Row("removed", "the limit of memory must hold"),
        "oom_score_adj": Row("removed", "it would let the kernel end others first"),
        "platform": Row("kept", "which image is pulled"),
        "ports": Row("removed", "tests publish none"),
        "profiles": Row("removed", "a service with a profile does not start"),
        "provider": Row("refused", "it starts a program on the host"),
        "pull_policy pull_refresh_after": Row("removed", "DoDo manages images"),
        "read_only": Row("kept", "less access"),
        "restart": Row("removed", "containers are not restarted"),
        "scale": Row("removed", "each service runs once"),
        "secrets": Row("kept", "what the top-level 'secrets' name"),
        "stdin_open": Row("kept", "nobody types"),
        "stop_grace_period": Row("kept", "DoDo waits 2 s"),
        "stop_signal": Row("kept", "a signal to the container"),
        "sysctls": Row("kept", "the engine allows those of the container's namespaces only"),
        "tty": Row("kept", "a terminal in the container"),
        "umask": Row("kept", "permissions of new files in the container"),
        "user": Row("kept", "a user in the container"),
        "userns_mode": Row("removed", "the engine's own"),
        "uts": Row("removed", "the container's own"),
        "working_dir": Row("kept", "a folder in the container"),
    }
)
BUILD = _table(
    {
        "additional_contexts": Row("rewritten", "folders of the repository, images and URLs", values.other_contexts),
        "args": Row("kept", "without variables of the host that are not passed"),
        "cache_from": Row("removed", "the engine has its own cache"),
        "cache_to": Row("removed", "it would write to the host or to a registry"),
        "context": Row("rewritten", "a folder of the repository, or a URL", values.context),
        "dockerfile": Row("kept", "a file of the repository", values.context),
        "dockerfile_inline": Row("kept", "a file"),
        "entitlements": Row("refused", "a build with them reaches the host"),
        "extra_hosts": Row("kept", "names of addresses"),
        "isolation": Row("removed", "it is for Windows"),
        "labels": Row("removed", "programs of the host act on them"),
        "network": Row("kept", "default and none only", values.build_network),
        "no_cache": Row("kept", "builds anew"),
        "no_cache_filter": Row("kept", "builds stages anew"),
        "platforms": Row("kept", "which image is built"),
        "privileged": Row("rewritten", "in hil tests only, where the rig allows it", values.privileged_build),
        "provenance sbom": Row("kept", "what is said of the image"),
        "pull": Row("kept", "which base images are pulled"),
        "secrets": Row("kept", "what the top-level 'secrets' name"),
        "shm_size": Row("rewritten", "the memory of `sandbox` at most"),
        "ssh": Row("removed", "no build gets keys of the host", values.keys_of_host),
        "tags": Row("removed", "they could replace other tests' images"),
        "target": Row("kept", "a stage of the file"),
        "ulimits": Row("rewritten", "those of `sandbox` at most, and no core dumps"),
    }
)
MOUNT = _table(
    {
        "bind": Row("rewritten", "see the options of a folder"),
        "consistency": Row("kept", "Linux ignores it"),
        "image": Row("kept", "a folder of an image"),
        "read_only": Row("kept", "less access"),
        "source": Row("rewritten", "of the repository, to be read or as a copy; see docs/reference/applications.md"),
        "target": Row("kept", "a path in the container"),
        "tmpfs": Row("rewritten", "the memory of `sandbox` at most"),
        "type": Row("kept", "bind, volume, tmpfs and image only", values.mount_type),
        "volume": Row("rewritten", "see the options of a volume"),
    }
)
BIND = _table(
    {
        "propagation": Row("kept", "private and rprivate only", values.propagation),
        "recursive": Row("kept", "enabled, disabled and readonly only", values.recursion),
        "create_host_path": Row("kept", "a missing folder is made, or refused"),
        "selinux": Row("kept", "a label of the folder"),
    }
)
MOUNTED_VOLUME = _table(
    {
        "labels": Row("removed", "programs of the host act on them"),
        "nocopy": Row("kept", "what an image has there"),
        "subpath": Row("kept", "a folder of the volume"),
    }
)
DEPLOY = _table(
    {
        "endpoint_mode": Row("removed", "each test has a network of its own"),
        "labels": Row("removed", "programs of the host act on them"),
        "mode replicas rollback_config update_config": Row("removed", "each service runs once"),
        "placement": Row("removed", "a test runs on one machine"),
        "resources": Row("rewritten", "within the limits"),
        "restart_policy": Row("removed", "containers are not restarted"),
    }
)
RESERVATIONS = _table(
    {
        "cpus": Row("kept", "compose ignores it"),
        "devices": Row("kept", "graphics processors; no other devices (CDI)"),
        "generic_resources": Row("removed", "they are for a swarm"),
        "memory": Row("removed", "a test has limits only"),
    }
)
VOLUME = _table(
    {
        "driver": Row("kept", "local only", values.volume_driver),
        "name": Row("removed", "each test has its own", values.volume_name),
        "driver_opts": Row(
            "rewritten",
            "tmpfs, or a folder: of the repository as a copy, or one that dodo.yml names",
            values.volume_options,
        ),
        "external": Row("kept", "where services mount it read-only"),
        "labels": Row("removed", "programs of the host act on them"),
    }
)
NETWORK = _table(
    {
        "attachable driver driver_opts enable_ipv4 enable_ipv6 external ipam labels name": Row(
            "removed", "each test has a network of its own"
        ),
        "internal": Row("removed", "a test's network has no way out unless dodo.yml allows it"),
    }
)
SECRET = _table(
    {
        "driver driver_opts template_driver": Row("refused", "a program of the engine would provide it"),
        "environment": Row("kept", "variables that are passed", values.content),
        "external": Row("refused", "the engine's secrets are not the application's"),
        "file": Row("rewritten", "a file of the repository", values.content),
        "labels": Row("kept", "they do nothing in a test"),
        "name": Row("removed", "compose names it"),
    }
)
CONFIG = {"content": Row("kept", "a text")} | {key: row for key, row in SECRET.items() if not key.startswith("driver")}
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
    **{path: _table({keys: Row("kept", "")}) for paths, keys in _NESTED.items() for path in paths.split()},
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
