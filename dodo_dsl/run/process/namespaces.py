"""An own network, IPC, process and ``/tmp`` for a test, by Linux namespaces; no other program is needed.

Inside, ``lo`` is up and carries multicast, ``/tmp`` and ``/dev/shm`` are empty and private, and of the folders that lay
in them those stay visible that the test needs, so that programs and specs kept there still run.
"""

import contextlib
import ctypes
import errno
import fcntl
import functools
import os
import signal
import socket
import stat
import struct
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path

_CLONE_NEWNS, _CLONE_NEWIPC, _CLONE_NEWUSER = 0x00020000, 0x08000000, 0x10000000
_CLONE_NEWPID, _CLONE_NEWNET = 0x20000000, 0x40000000
_MS_BIND, _MS_REC, _MS_PRIVATE, _MS_SLAVE, _MS_NOSUID, _MS_NODEV = 4096, 16384, 1 << 18, 1 << 19, 2, 4
_PR_SET_PDEATHSIG, _PR_SET_CHILD_SUBREAPER, _PR_SET_SECUREBITS, _NO_SETUID_FIXUP = 1, 36, 28, 4
_SIOCSIFFLAGS, _IFF_UP, _IFF_RUNNING = 0x8914, 1, 64
_RTM_NEWROUTE, _NLM_F_REQUEST, _NLM_F_ACK, _NLM_F_CREATE = 24, 1, 4, 0x400
_RTA_DST, _RTA_OIF, _RTA_PREFSRC = 1, 4, 7
_OPEN_TREE, _MOVE_MOUNT, _MOUNT_SETATTR = 428, 429, 442
"""System calls that have the same number on every processor."""
_AT_FDCWD, _AT_EMPTY_PATH, _AT_RECURSIVE = -100, 0x1000, 0x8000
_OPEN_TREE_CLONE, _MOVE_MOUNT_F_EMPTY_PATH, _MOUNT_ATTR_IDMAP = 1, 4, 0x00100000
_ENTERED = 0o755
_SHARED_SIZE = "size=1g,mode=1777"
SHARED = (Path("/tmp"), Path("/dev/shm"))
"""Where shared memories have their names."""

_libc = ctypes.CDLL(None, use_errno=True)


def _call(name: str, *arguments: object) -> None:
    if getattr(_libc, name)(*arguments) != 0:
        number = ctypes.get_errno()
        raise OSError(number, f"{name}: {os.strerror(number)}")


def _syscall(number: int, *arguments: int | bytes) -> int:
    result = _libc.syscall(*(ctypes.c_long(a) if isinstance(a, int) else a for a in (number, *arguments)))
    if result < 0:
        raise OSError(ctypes.get_errno(), f"system call {number}: {os.strerror(ctypes.get_errno())}")
    return int(result)


def die_with_parent(signal_number: int) -> None:
    """This process gets a signal when its parent dies, however it dies."""
    _call("prctl", _PR_SET_PDEATHSIG, signal_number, 0, 0, 0)


def begin(parent: int, masked: Sequence[str] = ()) -> None:
    """Between fork and exec of a child: it gets SIGTERM when its parent dies, and ends at once if that has happened.

    It sees /dev/null in the place of ``masked`` device files; raises OSError.
    """
    if masked:
        unshare(_CLONE_NEWNS)
        _call("mount", b"none", b"/", None, _MS_REC | _MS_SLAVE, None)
    for device in masked:
        bind(Path("/dev/null"), Path(device), deep=False)
    die_with_parent(signal.SIGTERM)
    if os.getppid() != parent:
        os._exit(128 + signal.SIGTERM)


def adopt_orphans() -> None:
    """Processes whose parent dies become children of this one instead of init's."""
    _call("prctl", _PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0)


def unshare(flags: int = _CLONE_NEWNET | _CLONE_NEWIPC | _CLONE_NEWNS | _CLONE_NEWPID) -> None:
    """Leaves the host's namespaces; the next fork is process 1 in them. Raises OSError where the kernel refuses."""
    user, group = os.getuid(), os.getgid()
    if user == 0:
        _call("unshare", flags)
        return
    _call("unshare", flags | _CLONE_NEWUSER)
    Path("/proc/self/setgroups").write_text("deny")
    Path("/proc/self/uid_map").write_text(f"{user} {user} 1")
    Path("/proc/self/gid_map").write_text(f"{group} {group} 1")


def enter(process: int) -> dict[Path, int]:
    """Joins the network and IPC namespaces of another process, and leaves the host's mounts and process numbers.

    The next fork is process 1. Gives descriptors of the other process's ``SHARED`` folders, for ``furnish``.
    Raises OSError: only root may do so.
    """
    other, own = os.pidfd_open(process), os.open("/proc/self/ns/mnt", os.O_RDONLY | os.O_CLOEXEC)
    _call("setns", other, _CLONE_NEWNET | _CLONE_NEWIPC | _CLONE_NEWNS)
    try:
        flags = _OPEN_TREE_CLONE | os.O_CLOEXEC
        trees = {path: _syscall(_OPEN_TREE, _AT_FDCWD, bytes(path), flags) for path in SHARED}
    finally:
        _call("setns", own, _CLONE_NEWNS)
        os.close(own)
        os.close(other)
    _call("unshare", _CLONE_NEWNS | _CLONE_NEWPID)
    return trees


def furnish(shown: Collection[Path], trees: Mapping[Path, int]) -> None:
    """Mounts, and the network of new namespaces; to be called by their process 1.

    With the ``trees`` of ``enter``, mounts are all. Of the folders in ``SHARED`` those stay that are ``shown``, which
    are empty to the other process, but no files: they may be another test's tokens.
    """
    _call("mount", b"none", b"/", None, _MS_REC | _MS_PRIVATE, None)
    mount("proc", Path("/proc"), "")
    for folder in filter(Path.is_dir, SHARED):
        old = os.open(folder, os.O_PATH | os.O_DIRECTORY)
        if trees:
            _syscall(_MOVE_MOUNT, trees[folder], b"", _AT_FDCWD, bytes(folder), _MOVE_MOUNT_F_EMPTY_PATH)
            os.close(trees[folder])
        else:
            mount("tmpfs", folder, _SHARED_SIZE)
        _bind_old(old, folder, shown)
    if not trees:
        _multicast()


def mount(kind: str, folder: Path, options: str) -> None:
    """A new file system at a folder, where no device and no change of user counts; raises OSError."""
    _call("mount", kind.encode(), bytes(folder), kind.encode(), _MS_NOSUID | _MS_NODEV, options.encode())


def bind(source: Path, target: Path, *, deep: bool) -> None:
    """Shows a folder at another place, ``deep`` with what is mounted in it; raises OSError."""
    _call("mount", bytes(source), bytes(target), None, _MS_BIND | (_MS_REC if deep else 0), None)


def bind_as(source: Path, target: Path, owner: int, user: int) -> None:
    """Shows a folder at another place, where what belongs to ``owner`` belongs to ``user`` and vice versa.

    By an ID-mapped mount (mount_setattr(2)); raises OSError if the kernel or the file system has none.
    """
    users = user_namespace(_swapped(owner, user))
    tree = _syscall(_OPEN_TREE, _AT_FDCWD, bytes(source), _OPEN_TREE_CLONE | _AT_RECURSIVE | os.O_CLOEXEC)
    attributes = struct.pack("QQQQ", _MOUNT_ATTR_IDMAP, 0, 0, users)
    try:
        _syscall(_MOUNT_SETATTR, tree, b"", _AT_EMPTY_PATH, attributes, len(attributes))
        _syscall(_MOVE_MOUNT, tree, b"", _AT_FDCWD, bytes(target), _MOVE_MOUNT_F_EMPTY_PATH)
    finally:
        os.close(tree)


def _swapped(one: int, other: int) -> str:
    """The mapping of a user namespace that exchanges two users (user_namespaces(7))."""
    low, high = sorted((one, other))
    between = [(0, 0, low), (low, high, 1), (low + 1, low + 1, high - low - 1), (high, low, 1)]
    return "".join(f"{inside} {outside} {count}\n" for inside, outside, count in between if count)


@functools.cache
def user_namespace(mapping: str, owner: int = 0) -> int:
    """A descriptor of a user namespace with a mapping of users and groups, which its owner may enter; raises OSError.

    Root makes it in the owner's place, who may be allowed none. It stays open.
    """
    ours, theirs = socket.socketpair()
    child = os.fork()
    if child == 0:
        ours.close()
        with contextlib.suppress(OSError):
            _call("prctl", _PR_SET_SECUREBITS, _NO_SETUID_FIXUP, 0, 0, 0)  # it keeps its capabilities
            os.setresuid(owner, owner, owner)
            _call("unshare", _CLONE_NEWUSER)
            socket.send_fds(theirs, [b"x"], [os.open("/proc/self/ns/user", os.O_RDONLY)])
            theirs.recv(1)
        os._exit(1)
    theirs.close()
    try:
        _, descriptors, _, _ = socket.recv_fds(ours, 1, 1)
        if not descriptors:
            raise OSError(errno.EPERM, "the kernel refuses user namespaces")
        for kind in ("uid_map", "gid_map"):
            Path(f"/proc/{child}/{kind}").write_text(mapping)
        return descriptors[0]
    finally:
        ours.close()
        os.waitpid(child, 0)


def _bind_old(old: int, folder: Path, shown: Collection[Path]) -> None:
    """Shows what is ``shown`` of an old folder in the new one that took its place, and closes the ``old`` descriptor.

    The application, which sees it without what is mounted there, has to get through to its own folder.
    """
    for target in (path for path in shown if path.parent == folder):
        with contextlib.suppress(FileNotFoundError):
            if stat.S_ISDIR(os.stat(target.name, dir_fd=old, follow_symlinks=False).st_mode):
                target.mkdir(exist_ok=True)
                target.chmod(_ENTERED)
                bind(Path(f"/proc/self/fd/{old}", target.name), target, deep=True)
    os.close(old)


def _multicast() -> None:
    """``lo`` is up; 224.0.0.0/4 goes through it, from 127.0.0.1 (rtnetlink): without that a join has no device."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as control:
        fcntl.ioctl(control, _SIOCSIFFLAGS, struct.pack("16sh14x", b"lo", _IFF_UP | _IFF_RUNNING))
    body = struct.pack("BBBBBBBBI", socket.AF_INET, 4, 0, 0, 254, 3, 253, 1, 0)
    for kind, value in (
        (_RTA_DST, socket.inet_aton("224.0.0.0")),
        (_RTA_OIF, struct.pack("i", socket.if_nametoindex("lo"))),
        (_RTA_PREFSRC, socket.inet_aton("127.0.0.1")),
    ):
        body += struct.pack("HH", 4 + len(value), kind) + value
    flags = _NLM_F_REQUEST | _NLM_F_ACK | _NLM_F_CREATE
    message = struct.pack("IHHII", 16 + len(body), _RTM_NEWROUTE, flags, 1, 0) + body
    with socket.socket(socket.AF_NETLINK, socket.SOCK_RAW, socket.NETLINK_ROUTE) as netlink:
        netlink.send(message)
        error = struct.unpack_from("i", netlink.recv(4096), 16)[0]
    if error:
        raise OSError(-error, f"multicast route: {os.strerror(-error)}")
