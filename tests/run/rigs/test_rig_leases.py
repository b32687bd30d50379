"""The leases of a rig, of its CID and its devices, whatever they are called; and its quarantine, kept in files."""

import asyncio
from pathlib import Path

import pytest

from dodo_dsl.run import leases
from dodo_dsl.run.rigs import leases as rig_leases
from dodo_dsl.run.rigs.leases import (
    all_quarantined,
    clear_quarantine,
    device_keys,
    devices_in,
    leased,
    quarantine,
    quarantined,
)
from dodo_dsl.run.rigs.problems import RigProblem
from tests.run.scripted import one_by_one, run


def test_flags_name_hardware() -> None:
    words = ["--serial=/dev/ttyACM0", "check", "--source=0", "--width=640", "--serial"]
    assert devices_in(words) == ["/dev/ttyACM0", "0", ""]


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("DODO_LEASES", str(tmp_path))
    return tmp_path


def test_cid_and_devices_are_held_together_and_released(folder: Path) -> None:
    async def scene() -> list[str]:
        async with leased(121, "mine", print, devices=["/dev/null", "/dev/zero"]) as descriptors:
            assert len(descriptors) == 3
            return sorted(path.name.split(".")[0] for path in folder.glob("*.lease"))

    names = asyncio.run(scene())
    assert names == sorted(["cid-121", *device_keys(["/dev/null", "/dev/zero"])])
    assert list(folder.glob("*.lease")) == []


def test_the_emulated_rig_has_none(folder: Path) -> None:
    async def scene() -> tuple[int, ...]:
        async with leased(None, "mine", print, devices=["emulated"]) as descriptors:
            return descriptors

    assert asyncio.run(scene()) == ()


def test_who_has_waited_for_the_cid_is_not_the_last_for_the_device(folder: Path) -> None:
    (device,) = device_keys(["/dev/null"])
    held = [leases.try_lease(name, {"test": "theirs"}) for name in ("cid-121", device)]
    order: list[str] = []

    async def user(name: str, cid: int | None) -> None:
        async with leased(cid, name, lambda _: None, devices=["/dev/null"]):
            order.append(name)

    async def scene() -> None:
        users = await one_by_one(user("both", 121), user("device", None))
        for lease in held:
            assert lease is not None
            lease.release()
            await asyncio.sleep(0.5)
        await asyncio.gather(*users)

    run(scene())
    assert order == ["both", "device"]


@pytest.mark.thorough
def test_a_busy_device_gives_the_cid_back(folder: Path) -> None:
    (name,) = device_keys(["/dev/null"])
    held = leases.try_lease(name, {"test": "theirs"})
    assert held is not None

    async def scene() -> None:
        async with leased(121, "mine", lambda _: None, 0.1, ["/dev/null"]):
            raise AssertionError("the device is held")

    with pytest.raises(leases.LeaseTimeout, match=r"no device came free within 0\.1 s; test theirs"):
        asyncio.run(scene())
    assert [path.name.split(".")[0] for path in folder.glob("*.lease")] == [name]
    held.release()


@pytest.fixture(autouse=True)
def state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("DODO_RIGS", str(tmp_path / "state"))
    return tmp_path / "state"


def test_no_variable_moves_that_of_hardware(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The machine's own device may be any but one of software; here the account's folder is another one."""
    device = next((str(p) for p in Path("/dev").iterdir() if rig_leases.is_hardware_device(str(p))), "")
    if not device:
        pytest.skip("no hardware device in /dev")
    monkeypatch.setattr(rig_leases, "shared_path", lambda _: None)
    monkeypatch.setattr(rig_leases, "account_path", lambda name: tmp_path / "account" / name)
    (tmp_path / "account").mkdir()
    quarantine("kiwi", "it has lost steps", [device])
    monkeypatch.setenv("DODO_RIGS", str(tmp_path / "elsewhere"))
    assert quarantined("kiwi", [device]) == "it has lost steps" == all_quarantined()["kiwi"]
    assert not rig_leases.is_hardware_device("/dev/null") and not rig_leases.is_hardware_device("/dev/nothing")


def test_it_lasts_until_it_is_cleared() -> None:
    assert (quarantined("kiwi"), all_quarantined(), clear_quarantine("kiwi")) == ("", {}, False)
    quarantine("kiwi", "it has lost steps")
    quarantine("other", "its camera is dark")
    assert all_quarantined() == {"kiwi": "it has lost steps", "other": "its camera is dark"}
    assert (clear_quarantine("kiwi"), quarantined("kiwi"), clear_quarantine("kiwi")) == (True, "", False)
    assert list(all_quarantined()) == ["other"]


@pytest.mark.parametrize("text", ["", "[]", "{}", "3", '{"reason"'])
def test_a_damaged_file_is_a_quarantine(state: Path, text: str) -> None:
    state.mkdir()
    (state / "kiwi.json").write_text(text)
    assert quarantined("kiwi") == "its quarantine file cannot be read"
    assert clear_quarantine("kiwi")


@pytest.mark.parametrize("name", ["", "../kiwi", "Kiwi", "a.b", "-a", "a b"])
def test_a_strange_name_reaches_no_file(state: Path, name: str) -> None:
    for call in (quarantined, clear_quarantine):
        with pytest.raises(RigProblem, match="is not a rig's name, expected lower-case letters, digits and hyphens"):
            call(name)
    with pytest.raises(RigProblem):
        quarantine(name, "x")
    assert not state.exists()


def test_other_files_are_no_rigs(state: Path) -> None:
    state.mkdir()
    for name in ("kiwi.txt", "Upper.json", "kiwi.4711.part"):
        (state / name).touch()
    assert all_quarantined() == {}


def test_a_quarantine_that_cannot_be_written_is_an_error_with_its_reason(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setenv("DODO_RIGS", str(tmp_path / "file" / "rigs"))
    with pytest.raises(RigProblem, match=r"cannot be written to '.*kiwi\.json': Not a directory \(it has lost steps\)"):
        quarantine("kiwi", "it has lost steps")
