"""Which programs listen on a bus: by the kernel's own ``/proc``, and by one that is written for the test."""

import os
from pathlib import Path

import pytest

from dodo_dsl.opendlv.session import Session
from dodo_dsl.run.listeners import buses, joined, listening
from tests.run.load.test_service_use import Proc

ROW = "  72: {local} 00000000:0000 07 00000000:00000000 00:00000000 00000000     0        0 {inode} 2 0 0"


def put(proc: Proc, pid: int, parent: int, sockets: dict[int, str]) -> None:
    """A process in a network of its own with sockets, by inode: the local address and port in hex."""
    proc.put(pid, parent)
    folder = proc.root / str(pid)
    (folder / "fd").mkdir()
    (folder / "fd" / "0").symlink_to("/dev/null")
    for inode in sockets:
        (folder / "fd" / str(inode)).symlink_to(f"socket:[{inode}]")
    (folder / "net").mkdir()
    rows = (ROW.format(local=local, inode=inode) for inode, local in sockets.items())
    (folder / "net" / "udp").write_text("\n".join(("  sl  local_address rem_address ...", *rows, "")))


def test_a_socket_at_the_port_listens_in_whatever_process_of_a_service(tmp_path: Path) -> None:
    proc = Proc(tmp_path)
    put(proc, 10, 1, {})
    put(proc, 11, 10, {501: "800000E1:2F8F"})
    put(proc, 20, 1, {502: "00000000:D431"})
    put(proc, 99, 1, {503: "800000E1:2F8F"})
    assert listening({10: "driver", 20: "lane", 30: "ended"}, tmp_path) == {"driver"}
    (tmp_path / "11" / "fd" / "501").unlink()
    assert listening({10: "driver", 20: "lane"}, tmp_path) == set(), "the socket is another process's"


def test_nobody_knows_where_the_kernel_hides_a_service_s_sockets(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    proc, refused = Proc(tmp_path), {"11"}
    for pid, parent in ((10, 1), (11, 10), (20, 1)):
        put(proc, pid, parent, {500 + pid: "800000E1:2F8F"})
    real = Path.iterdir

    def iterdir(path: Path) -> object:
        if path.name == "fd" and path.parent.name in refused:
            raise PermissionError
        return real(path)

    monkeypatch.setattr(Path, "iterdir", iterdir)
    assert listening({10: "driver", 20: "lane"}, tmp_path) == {"driver", "lane"}
    refused.add("10")
    assert listening({10: "driver", 20: "lane"}, tmp_path) is None


def test_the_kernel_s_own_sockets(cid: int) -> None:
    me = {os.getpid(): "me"}
    assert (listening(me), cid in buses([os.getpid()])) == (set(), False)
    with Session(cid):
        assert (listening(me), cid in buses([os.getpid(), 0])) == ({"me"}, True)
    assert (listening(me), cid in buses([os.getpid()])) == (set(), False)
    assert (buses([0]), joined(Path("/proc/0"))) == (set(), None), "a network that cannot be seen"
