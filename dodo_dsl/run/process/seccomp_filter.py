"""System calls that no OpenDLV program needs and that reach out of a sandbox: they fail with EPERM.

As in Docker's default profile, but without its exceptions for capabilities, which an application has none of.
"""

import functools
import os
import socket

_REFUSED = (
    "acct", "add_key", "adjtimex", "bpf", "clock_adjtime", "clock_settime", "delete_module", "finit_module",
    "fsconfig", "fsmount", "fsopen", "fspick", "init_module", "io_uring_enter", "io_uring_register",
    "io_uring_setup", "ioperm", "iopl", "kcmp", "kexec_file_load", "kexec_load", "keyctl", "lookup_dcookie",
    "mount", "mount_setattr", "move_mount", "name_to_handle_at", "open_by_handle_at", "open_tree",
    "perf_event_open", "personality", "pidfd_getfd", "pivot_root", "process_vm_readv", "process_vm_writev",
    "ptrace", "quotactl", "reboot", "request_key", "setdomainname", "sethostname", "setns", "settimeofday",
    "swapoff", "swapon", "syslog", "umount2", "unshare", "userfaultfd", "vhangup",
)  # fmt: skip
_EPERM, _ENOSYS = 1, 38
_CLONE_NAMESPACES = 0x7E020080
_SOCKET_TYPE = 0xF
_FAMILIES = (socket.AF_PACKET, socket.AF_ALG, socket.AF_VSOCK)
_F_SETLEASE = 1024
"""fcntl(2): opening a file under a lease, as DoDo does its own, waits for up to 45 s."""
_TIOCSTI, _TIOCLINUX = 0x5412, 0x541C


@functools.cache
def program() -> bytes:
    """The filter as the kernel reads it (struct sock_filter, seccomp(2)); raises OSError."""
    try:
        import pyseccomp as seccomp
    except (ImportError, RuntimeError, OSError) as error:
        raise OSError(f"libseccomp cannot be loaded: {error}") from None
    rules = seccomp.SyscallFilter(seccomp.ALLOW)
    refused = seccomp.ERRNO(_EPERM)
    for name in _REFUSED:
        try:
            rules.add_rule(refused, name)  # for a call that only other processors have, that is nothing
        except OSError as error:
            raise OSError(f"libseccomp does not know the system call {name}, it is too old: {error}") from None
    for flag in (1 << bit for bit in range(32) if _CLONE_NAMESPACES >> bit & 1):
        rules.add_rule(refused, "clone", seccomp.Arg(0, seccomp.MASKED_EQ, flag, flag))
    rules.add_rule(seccomp.ERRNO(_ENOSYS), "clone3")  # its flags lie in memory; libraries use clone then
    for family in _FAMILIES:
        rules.add_rule(refused, "socket", seccomp.Arg(0, seccomp.EQ, int(family)))
    raw = seccomp.Arg(1, seccomp.MASKED_EQ, _SOCKET_TYPE, int(socket.SOCK_RAW))
    for family in (socket.AF_INET, socket.AF_INET6):
        rules.add_rule(refused, "socket", seccomp.Arg(0, seccomp.EQ, int(family)), raw)
    for request in (_TIOCSTI, _TIOCLINUX):
        rules.add_rule(refused, "ioctl", seccomp.Arg(1, seccomp.MASKED_EQ, 0xFFFFFFFF, request))
    for name in ("fcntl", "fcntl64"):
        rules.add_rule(refused, name, seccomp.Arg(1, seccomp.MASKED_EQ, 0xFFFFFFFF, _F_SETLEASE))
    with os.fdopen(os.memfd_create("filter"), "w+b") as file:
        rules.export_bpf(file)
        file.seek(0)
        return file.read()
