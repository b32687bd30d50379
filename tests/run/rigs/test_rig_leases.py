"""The leases of a rig: its CID and its devices, whatever they are called."""

import asyncio
from pathlib import Path

import pytest

from dodo_dsl.run import leases
from dodo_dsl.run.rigs.leases import device_leases, devices_in, leased
from tests.run.scripted import run


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
    assert names == sorted(["cid-121", *device_leases(["/dev/null", "/dev/zero"])])
    assert list(folder.glob("*.lease")) == []


def test_the_emulated_rig_has_none(folder: Path) -> None:
    async def scene() -> tuple[int, ...]:
        async with leased(None, "mine", print, devices=["emulated"]) as descriptors:
            return descriptors

    assert asyncio.run(scene()) == ()


def test_who_has_waited_for_the_cid_is_not_the_last_for_the_device(folder: Path) -> None:
    (device,) = device_leases(["/dev/null"])
    held = [leases.try_lease(name, {"test": "theirs"}) for name in ("cid-121", device)]
    order: list[str] = []

    async def user(name: str, cid: int | None) -> None:
        async with leased(cid, name, lambda _: None, devices=["/dev/null"]):
            order.append(name)

    async def scene() -> None:
        users = []
        for name, cid in (("both", 121), ("device", None)):
            users.append(asyncio.ensure_future(user(name, cid)))
            await asyncio.sleep(0.05)
        for lease in held:
            assert lease is not None
            lease.release()
            await asyncio.sleep(0.5)
        await asyncio.gather(*users)

    run(scene())
    assert order == ["both", "device"]


@pytest.mark.thorough
def test_a_busy_device_gives_the_cid_back(folder: Path) -> None:
    (name,) = device_leases(["/dev/null"])
    held = leases.try_lease(name, {"test": "theirs"})
    assert held is not None

    async def scene() -> None:
        async with leased(121, "mine", lambda _: None, 0.1, ["/dev/null"]):
            raise AssertionError("the device is held")

    with pytest.raises(leases.LeaseTimeout, match=r"no device came free within 0\.1 s; test theirs"):
        asyncio.run(scene())
    assert [path.name.split(".")[0] for path in folder.glob("*.lease")] == [name]
    held.release()
