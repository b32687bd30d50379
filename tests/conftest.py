"""Options and fixtures that all tests share."""

import contextlib
import gc
import os
import random
import socket
import subprocess
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

from dodo_dsl.terminal import WIDE
from tests.faults import Book

settings.register_profile("search", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.register_profile("dodo", settings.get_profile("search"), derandomize=True, max_examples=25)
settings.register_profile("quick", settings.get_profile("dodo"), max_examples=20)
settings.load_profile("dodo")  # the same examples each time: chance and the machine's speed decide no test

for variable in ("NO_COLOR", "FORCE_COLOR"):  # tests say themselves when there are colours
    os.environ.pop(variable, None)
os.environ["COLUMNS"] = str(WIDE)  # whatever terminal the tests are started in

REALTIME_RERUNS, REALTIME_REST_S, REALTIME_LIMIT_S, ENGINE_LIMIT_S = 2, 5, 300, 400
HANGS = "from pytest-timeout"

PRIORITIES = {"realtime": -10, "engine": -5}
"""How nice tests of a mark are beside others, where this user may be less so."""
PATIENT = os.nice(0) if os.geteuid() == 0 else os.nice(0) + 10
"""How nice others are."""
IS_BESIDE_OTHERS = "PYTEST_XDIST_WORKER" in os.environ


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--update-goldens", action="store_true", help="write expected output instead of comparing")


def pytest_collection() -> None:
    """Thousands of tests and their modules stay: looking for garbage among them would take a fifth of the time."""
    gc.disable()


def pytest_collection_finish() -> None:
    gc.freeze()
    gc.enable()


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Whatever needs the rig's firmware in its simulator needs real time; that and an engine are slow.

    A test in real time has two more tries, as other work on this machine may keep it waiting; none if it hangs. One of
    an engine has another one, which is for an engine that did not answer.
    """
    for item in items:
        if "firmware" in getattr(item, "fixturenames", ()):
            item.add_marker(pytest.mark.realtime)
        if item.get_closest_marker("realtime"):
            item.add_marker(pytest.mark.timeout(REALTIME_LIMIT_S))
            item.add_marker(
                pytest.mark.flaky(reruns=REALTIME_RERUNS, reruns_delay=REALTIME_REST_S, rerun_except=[HANGS])
            )
        if item.get_closest_marker("engine"):
            # not its set-up, where the first of them builds the images: that takes what the machine needs
            item.add_marker(pytest.mark.timeout(ENGINE_LIMIT_S, func_only=True))
            item.add_marker(pytest.mark.flaky(reruns=1, only_rerun=["Read timed out", "TimeoutExpired"]))
        if item.get_closest_marker("engine") or item.get_closest_marker("realtime"):
            item.add_marker(pytest.mark.slow)
    if IS_BESIDE_OTHERS:
        _share_out(items)


def _share_out(items: list[pytest.Item]) -> None:
    """Groups for ``--dist loadgroup``, of which one process runs each, in the order in which processes take them.

    Those with an engine are one group and those in real time two, as they mostly wait and disturb one another; they
    begin at once. Then come the slow ones, each by itself, and the quick ones, file by file.
    """
    counts = Counter(item.path for item in items if item.get_closest_marker("realtime"))
    rigs = {path: number % 2 for number, (path, _) in enumerate(counts.most_common())}
    order = {}
    for item in items:
        if item.get_closest_marker("engine"):
            order[item], group = 0, "engine"
        elif item.get_closest_marker("realtime"):
            order[item], group = 1 + rigs[item.path], f"realtime-{rigs[item.path]}"
        else:
            is_slow = item.get_closest_marker("slow") is not None
            order[item], group = 3 + (not is_slow), "" if is_slow else str(item.path)
        if group:
            item.add_marker(pytest.mark.xdist_group(group), append=order[item] > 3)
    items.sort(key=order.__getitem__)


def pytest_runtest_setup(item: pytest.Item) -> None:
    if IS_BESIDE_OTHERS:
        wanted = next((nice for mark, nice in PRIORITIES.items() if item.get_closest_marker(mark)), PATIENT)
        with contextlib.suppress(OSError):
            os.setpriority(os.PRIO_PROCESS, 0, wanted)


@pytest.fixture(autouse=True, scope="session")
def own_state(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Runs of tests are no part of this user's history, and put no rig into quarantine."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("DODO_RIGS", str(tmp_path_factory.mktemp("rigs")))
        patch.setenv("DODO_HISTORY", str(tmp_path_factory.mktemp("state") / "history.jsonl"))
        yield


@pytest.fixture
def update_goldens(request: pytest.FixtureRequest) -> bool:
    return bool(request.config.getoption("--update-goldens"))


@pytest.fixture
def book(update_goldens: bool) -> Book:
    """Takes faults and what became of them, for their page."""
    return Book(update_goldens)


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """A folder on a disk of 64 KiB."""
    folder = tmp_path / "small"
    folder.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", str(folder)]
    result = subprocess.run(mount, capture_output=True, text=True, check=False)
    if result.returncode:
        pytest.skip(f"a small disk cannot be made here: {result.stderr.strip() or 'no mount'}")
    yield folder
    subprocess.run(["umount", "--lazy", str(folder)], check=True)


@pytest.fixture
def shared_data() -> Callable[[str], Path]:
    """Path of real data by file name; it is no part of the project, and the test skips where it is absent."""
    root = Path(__file__).parents[2] / "shared" / "data"
    folder = Path(os.environ.get("DODO_SHARED_DATA") or root)

    def path(name: str) -> Path:
        if not (folder / name).is_file():
            pytest.skip(f"real data is absent: {name} (DODO_SHARED_DATA names its folder)")
        return folder / name

    return path


@pytest.fixture
def cid() -> Iterator[int]:
    """A session number that no other test on this machine uses at the same time.

    Those from 128 on are for tests that ``dodo run`` gives one, 111 and 112 for cars.
    """
    lease = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
    for number in random.sample(range(2, 111), 109):
        with contextlib.suppress(OSError):
            lease.bind(f"\0dodo-test-cid-{number}")  # an abstract name dies with its holder
            break
    yield number
    lease.close()
