"""Attacks of an application on the machine that tests it: each returns what it got hold of, or something false.

Run as a program, it tries each in a process of its own, and prints a line of JSON an attack: its name, whether it got
through, and how it ended; then it waits, or ends with ``--ends``. It needs only Python, as an application's own
interpreter has it.
"""

import ctypes
import fcntl
import json
import os
import platform
import re
import resource
import signal
import socket
import stat
import sys
from collections.abc import Callable
from pathlib import Path

_libc = ctypes.CDLL(None, use_errno=True)
_X86 = platform.machine() == "x86_64"
_CALLS = {  # name: numbers on x86-64 and on 64-bit Arm (include/uapi/asm-generic/unistd.h)
    "ptrace": (101, 117), "mount": (165, 40), "umount2": (166, 39), "pivot_root": (155, 41), "swapon": (167, 224),
    "reboot": (169, 142), "sethostname": (170, 161), "setdomainname": (171, 162), "init_module": (175, 105),
    "delete_module": (176, 106), "quotactl": (179, 60), "clock_settime": (227, 112), "settimeofday": (164, 170),
    "adjtimex": (159, 171), "clock_adjtime": (305, 266), "kexec_load": (246, 104), "add_key": (248, 217),
    "request_key": (249, 218), "keyctl": (250, 219), "unshare": (272, 97), "perf_event_open": (298, 241),
    "open_by_handle_at": (304, 265), "setns": (308, 268), "process_vm_readv": (310, 270),
    "process_vm_writev": (311, 271), "finit_module": (313, 273), "bpf": (321, 280), "userfaultfd": (323, 282),
    "io_uring_setup": (425, 425), "open_tree": (428, 428), "move_mount": (429, 429), "fsopen": (430, 430),
    "fsmount": (432, 432), "pidfd_getfd": (438, 438), "mount_setattr": (442, 442), "syslog": (103, 116),
    "acct": (163, 89), "chroot": (161, 51), "clone3": (435, 435),
}  # fmt: skip
INHERITED = [number for number in range(3, 1000) if os.path.exists(f"/proc/self/fd/{number}")]
FOLDERS = [path for path in Path("/tmp").iterdir() if path.is_dir() and not path.is_symlink()]
"""Where something is mounted for services of DoDo, which share this ``/tmp``."""
Attack = Callable[[], object]
ATTACKS: dict[str, Attack] = {}
PLACES: dict[str, str] = json.loads(os.environ.get("ATTACKED", "{}"))
"""Files and folders of the machine that the application must not reach, by what they are."""


def attack(function: Attack) -> Attack:
    ATTACKS[function.__name__.replace("_", "-")] = function
    return function


def _syscall(name: str, *arguments: object) -> bool:
    """Whether a system call got as far as its arguments: EPERM, EACCES and ENOSYS say that it did not."""
    number = _CALLS[name][0 if _X86 else 1]
    result = _libc.syscall(ctypes.c_long(number), *arguments)
    return result >= 0 or ctypes.get_errno() not in (1, 13, 38)


def _define_calls() -> None:
    folder, kind = ctypes.c_char_p(b"/tmp"), ctypes.c_char_p(b"tmpfs")
    zero = [ctypes.c_long(0)] * 6
    arguments: dict[str, list[object]] = {
        "mount": [kind, folder, kind, *zero[:2]],
        "umount2": [folder, ctypes.c_long(2)],
        "pivot_root": [folder, folder],
        "swapon": [ctypes.c_char_p(b"/nothing"), *zero[:1]],
        "reboot": [ctypes.c_long(0xFEE1DEAD), ctypes.c_long(672274793), ctypes.c_long(0)],
        "sethostname": [ctypes.c_char_p(b"mine"), ctypes.c_long(4)],
        "setdomainname": [ctypes.c_char_p(b"mine"), ctypes.c_long(4)],
        "unshare": [ctypes.c_long(0x10000000)],
        "keyctl": [ctypes.c_long(0), ctypes.c_long(-3), ctypes.c_long(1)],
        "chroot": [folder],
        "acct": [ctypes.c_char_p(b"/nothing")],
        "syslog": [ctypes.c_long(3), ctypes.c_char_p(b" " * 100), ctypes.c_long(100)],
        "ptrace": [ctypes.c_long(0)],
        "settimeofday": [ctypes.byref((ctypes.c_long * 2)(1, 0)), ctypes.c_long(0)],
        "clock_settime": [ctypes.c_long(0), ctypes.byref((ctypes.c_long * 2)(1, 0))],
        "adjtimex": [ctypes.byref((ctypes.c_uint * 64)(1))],
        "clock_adjtime": [ctypes.c_long(0), ctypes.byref((ctypes.c_uint * 64)(1))],
    }
    for name in _CALLS:
        words = arguments.get(name, zero)
        ATTACKS[f"call-{name}"] = lambda name=name, words=words: _syscall(name, *words)  # type: ignore[misc]


_define_calls()


@attack
def namespace_of_users_by_clone() -> object:
    """clone(2) with CLONE_NEWUSER."""
    number = 56 if _X86 else 220
    child = _libc.syscall(ctypes.c_long(number), ctypes.c_long(0x10000000 | signal.SIGCHLD), *[ctypes.c_long(0)] * 4)
    if child == 0:
        os._exit(0)
    return child > 0


def _read(path: str) -> object:
    place = Path(path)
    if place.is_dir():
        return sorted(os.listdir(place))[:5]
    return place.read_bytes()[:100]


def _define_places() -> None:
    for name, path in PLACES.items():
        ATTACKS[f"read-{name}"] = lambda path=path: _read(path)  # type: ignore[misc]
        ATTACKS[f"write-{name}"] = lambda path=path: _write(path)  # type: ignore[misc]
    for name, path in SYSTEM.items():
        ATTACKS[f"read-{name}"] = lambda path=path: _read(path)  # type: ignore[misc]
    for name, path in READ_ONLY.items():
        ATTACKS[f"write-{name}"] = lambda path=path: _write(path)  # type: ignore[misc]


SYSTEM = {
    "shadow": "/etc/shadow", "home-of-root": "/root/.bashrc", "log": "/var/log", "run": "/run",
    "docker-socket": "/var/run/docker.sock", "var-lib": "/var/lib", "mnt": "/mnt", "srv": "/srv", "boot": "/boot",
    "kernel-log": "/dev/kmsg", "memory": "/dev/mem", "disk": "/dev/vda", "loop": "/dev/loop0", "rtc": "/dev/rtc0",
    "kernel-memory": "/proc/kcore", "debug": "/sys/kernel/debug", "cgroups": "/sys/fs/cgroup",
    "firmware": "/sys/firmware", "modules": "/sys/module", "spool": "/var/spool/cron",
}  # fmt: skip
READ_ONLY = {
    "etc": "/etc/passwd", "usr": "/usr/bin/env", "core-pattern": "/proc/sys/kernel/core_pattern",
    "sysrq": "/proc/sysrq-trigger", "hostname": "/proc/sys/kernel/hostname", "root": "/", "usr-folder": "/usr",
    "modprobe": "/proc/sys/kernel/modprobe", "overcommit": "/proc/sys/vm/overcommit_memory",
    "forwarding": "/proc/sys/net/ipv4/ip_forward", "processor": "/sys/devices/system/cpu/cpu1/online", "home": "/home",
    "interpreter": sys.executable, "its-library": os.__file__, "optional": "/opt",
    "run": "/run", "temporary": "/var/tmp", "devices": "/dev",
}  # fmt: skip


def _write(path: str) -> object:
    place = Path(path)
    if place.is_dir():
        (place / "mine").write_text("mine")
        return "a new file"
    with place.open("r+b") as file:
        return file.writable() and "opened for writing"


_define_places()


@attack
def finds_files_of_tests() -> object:
    """By what they are called, wherever they are: specs, maps, recordings, results and compiled tests."""
    found = []
    for folder, folders, files in os.walk("/"):
        folders[:] = [] if folder in ("/proc", "/sys") else [name for name in folders if name != "__pycache__"]
        found += [os.path.join(folder, name) for name in files if _is_of_tests(name)]
    return [path for path in found if _is_readable(path)]


def _is_of_tests(name: str) -> bool:
    return name.endswith((".dodo.yml", ".rec")) or name in ("map.json", "results.json", "test.json")


def _is_readable(path: str) -> bool:
    """As DoDo's: other programs have files of these names, too."""
    try:
        begin = Path(path).read_bytes()[:100] if Path(path).is_file() else b""
    except OSError:
        return False
    return any(mark in begin for mark in (b"dodo", b'"model"', b"\x0d\xa4"))


def _status(name: str) -> str:
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(line.split()[1] for line in lines if line.startswith(f"{name}:"))


def _worked(call: Callable[..., object], *arguments: object) -> str:
    """What a call did that raises nothing."""
    call(*arguments)
    return f"{call.__name__}{arguments}"


def _opened(path: str, flags: int = os.O_RDONLY) -> int:
    return os.open(path, flags)


def _connected(kind: int, address: object) -> str:
    with socket.socket(kind, socket.SOCK_STREAM) as client:
        client.settimeout(1)
        return _worked(client.connect, address)


_CAPABILITIES = ("CapInh", "CapPrm", "CapEff", "CapBnd", "CapAmb")
_ADDRESSES = (0x40000, 0x400008, 0x7FFFFFFF, 0xFFFDFFFF)
_NETWORKS = ("lo", "sit0", "tunl0", "ip6tnl0")
_ENDLESS = (resource.RLIM_INFINITY, resource.RLIM_INFINITY)
ATTACKS |= {
    # who then opens it has to wait
    "lease-on-a-file-of-the-machine": lambda: (
        fcntl.fcntl(_opened(f"{sys.prefix}/pyvenv.cfg"), fcntl.F_SETLEASE, 0) == 0
    ),
    "memory-at-known-addresses": lambda: [hex(kind) for kind in _ADDRESSES if _libc.personality(kind) != -1],
    "has-capabilities": lambda: {name: _status(name) for name in _CAPABILITIES if int(_status(name), 16)},
    "may-gain-privileges": lambda: _status("NoNewPrivs") != "1",
    "has-no-filter": lambda: _status("Seccomp") != "2",
    "is-root": lambda: os.getuid() == 0 or os.geteuid() == 0,
    "becomes-root": lambda: _worked(os.setuid, 0),
    "becomes-root-in-a-saved-id": lambda: _worked(os.setresuid, 0, 0, 0),
    "changes-groups": lambda: _worked(os.setgroups, [0]),
    "has-groups-of-root": lambda: os.getgid() == 0 or 0 in os.getgroups(),
    "inherited-descriptors": lambda: INHERITED,
    "raw-socket": lambda: socket.socket(socket.AF_INET, socket.SOCK_RAW, socket.IPPROTO_ICMP),
    "raw-socket-of-version-6": lambda: socket.socket(socket.AF_INET6, socket.SOCK_RAW, socket.IPPROTO_ICMPV6),
    "packet-socket": lambda: socket.socket(socket.AF_PACKET, socket.SOCK_RAW, 3),
    "packet-socket-without-headers": lambda: socket.socket(socket.AF_PACKET, socket.SOCK_DGRAM, 3),
    "socket-of-the-kernels-ciphers": lambda: socket.socket(socket.AF_ALG, socket.SOCK_SEQPACKET, 0),
    "socket-to-the-hypervisor": lambda: socket.socket(socket.AF_VSOCK, socket.SOCK_STREAM),
    "reaches-the-internet": lambda: _connected(socket.AF_INET, ("1.1.1.1", 53)),
    "sends-to-the-networks-of-the-machine": lambda: socket.socket(type=socket.SOCK_DGRAM).sendto(b"x", ("10.0.0.1", 9)),
    "other-devices-of-the-network": lambda: [name for _, name in socket.if_nameindex() if name not in _NETWORKS],
    "abstract-socket-of-the-machine": lambda: _connected(socket.AF_UNIX, "\0" + Path(PLACES["secret"]).name),
    "makes-a-device": lambda: _worked(os.mknod, "/tmp/mine", stat.S_IFBLK | 0o600, os.makedev(254, 0)),
    "types-into-the-terminal": lambda: fcntl.ioctl(_opened("/dev/ptmx", os.O_RDWR), 0x5412, b"x") == 0,
    "writes-a-core": lambda: resource.getrlimit(resource.RLIMIT_CORE)[1],
    "raises-its-limits": lambda: _worked(resource.setrlimit, resource.RLIMIT_NPROC, _ENDLESS),
    "opens-files-without-end": lambda: [_opened("/dev/null") for _ in range(20_000)] != [],
    # System V shared memory that is not this test's
    "segments-of-the-machine": lambda: Path("/proc/sysvipc/shm").read_text().count("\n") > 50,
    "shared-memory-of-the-machine": lambda: Path(PLACES["secret"]).name in os.listdir("/dev/shm"),
    "secrets-in-the-environment": lambda: re.findall(r"\bCI_\w*|\w*TOKEN\w*|\w*SECRET\w*", " ".join(os.environ)),
    "root-of-the-first-process": lambda: os.listdir("/proc/1/root" + PLACES["repository"]),
    "slower-clock-for-others": lambda: _worked(os.setpriority, os.PRIO_PROCESS, 0, -20),
    "real-time-priority": lambda: _worked(os.sched_setscheduler, 0, os.SCHED_FIFO, os.sched_param(50)),
    "locks-memory": lambda: resource.getrlimit(resource.RLIMIT_MEMLOCK)[1] > 1 << 30 and _libc.mlockall(3) == 0,
    # where the test's services meet, in any environment that it sees
    "secrets-in-its-arguments-neighbours": lambda: [
        path for path in Path("/proc").glob("[0-9]*/environ") if b"DODO_CHANNEL" in path.read_bytes()
    ],
    # its own variables and words, and one of the runner, name the folder
    "sees-names-of-the-machines-folders": lambda: os.path.lexists(PLACES["folder"]),
}


@attack
def sees_processes_of_others() -> object:
    """Only its own, bubblewrap's first process and setpriv's."""
    own = os.getpid(), os.getppid(), 1
    commands = {p: Path(f"/proc/{p}/cmdline").read_bytes() for p in map(int, filter(str.isdigit, os.listdir("/proc")))}
    return {p: c for p, c in commands.items() if p not in own and b"attacks" not in c and b"bwrap" not in c}


@attack
def kills_all_that_it_can() -> object:
    """SIGKILL to everybody in sight; those of its own namespace are all that may be hit."""
    hit = []
    for pid in map(int, filter(str.isdigit, os.listdir("/proc"))):
        if pid not in (1, os.getpid(), os.getppid()) and b"attacks" not in Path(f"/proc/{pid}/cmdline").read_bytes():
            os.kill(pid, signal.SIGKILL)
            hit.append(pid)
    return hit


@attack
def starts_processes_without_end() -> object:
    children = []
    try:
        for _ in range(3000):
            child = os.fork()
            if child == 0:
                signal.pause()
            children.append(child)
    finally:
        for child in children:
            os.kill(child, signal.SIGKILL)
            os.waitpid(child, 0)
    return len(children)


@attack
def writes_a_file_without_end() -> object:
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    with open("/tmp/large", "wb") as file:
        try:
            file.truncate(5 * 10**9)
        finally:
            os.unlink("/tmp/large")
    return "5 GB"


@attack
def link_out_of_the_sandbox() -> object:
    os.symlink(PLACES["results"], "/tmp/link-out")
    try:
        return os.listdir("/tmp/link-out")
    finally:
        os.unlink("/tmp/link-out")


@attack
def takes_the_place_of_folders_of_services() -> object:
    """What is mounted there would go in all namespaces, and a link of its own be what services find."""
    through = [] if FOLDERS else ["there is none"]
    for path in FOLDERS:
        other, exchange = Path(f"{path}-other"), 2
        other.mkdir()
        renamed = (-100, os.fsencode(path), -100, os.fsencode(other), exchange)
        if _libc.syscall(ctypes.c_long(316 if _X86 else 276), *renamed) == 0:
            through.append(f"{path} exchanged")
        for remove in (os.rmdir, os.unlink, lambda path: os.rename(path, f"{path}-gone")):
            try:
                remove(path)
                os.symlink(PLACES["results"], path)
                through.append(f"{path} replaced")
                break
            except OSError:
                pass
    return through


@attack
def removes_the_services_entries() -> object:
    """Where they meet."""
    gone = []
    for folder, _, names in [*os.walk("/tmp"), *os.walk("/dodo")]:
        for name in names if "channel" in folder else []:
            os.unlink(f"{folder}/{name}")
            gone.append(name)
    return gone


def _tried(name: str) -> dict[str, object]:
    reader, writer = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(reader)
        try:
            got = ATTACKS[name]()
            told: dict[str, object] = {"through": bool(got), "how": repr(got)[:200]}
        except BaseException as error:  # noqa: BLE001
            told = {"through": False, "how": f"{type(error).__name__}: {error}"[:200]}
        os.write(writer, json.dumps(told).encode())
        os._exit(0)
    os.close(writer)
    with os.fdopen(reader, "rb") as answer:
        data = answer.read()
    _, status = os.waitpid(child, 0)
    ended = os.waitstatus_to_exitcode(status)
    return json.loads(data) if data else {"through": False, "how": f"ended by {ended}"}


def main() -> None:
    for name in ATTACKS:
        print(json.dumps({"attack": name, **_tried(name)}), flush=True)
    Path("/tmp/attacks-done").touch()
    if "--ends" not in sys.argv:
        signal.pause()


if __name__ == "__main__":
    main()
