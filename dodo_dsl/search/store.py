"""The drives of a study by their values, kept by Optuna: in a journal file, or in a database that workers share.

A drive is a trial. A running trial is the claim of a worker, which others leave to it while it lives.
"""

import contextlib
import json
import os
import re
import socket
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from optuna.storages import BaseStorage
    from optuna.trial import FrozenTrial

SCHEME = "://"
_POSTGRES = re.compile(r"postgres(ql)?(?=://)")
_PASSWORD = re.compile(r"(:/+[^/@:\s]*):.*@", re.DOTALL)
_PARAMETER = re.compile(r"([?&](?:ssl)?password=)[^&\s'\"]*")
_EXPECTED = "expected the path of a file, or an address as postgresql://USER@HOST/DATABASE"
_PAUSE_S, _TABLES_S = 0.2, 2.0
PATIENCE_S = 180.0
"""What another machine claimed so long ago is driven again by a worker that has nothing else to do."""


def masked(text: str) -> str:
    """The text with ``***`` for each password of an address in it."""
    return _PARAMETER.sub(r"\1***", _PASSWORD.sub(r"\1:***@", text))


class StorageProblem(Exception):
    """The storage cannot be reached, refuses, or went away."""

    usage = False


class OtherSearch(Exception):
    """The storage holds what cannot be continued, or its address cannot be read."""

    usage = True


@dataclass(frozen=True)
class Drive:
    """What became of a test at some values; ``number`` counts drives in the order in which they were asked for.

    ``margin`` is the least of its checks, from -1 to 1, negative if it failed; None for an error. ``checks`` are the
    names of those that failed, with commas.
    """

    number: int
    values: Mapping[str, str]
    outcome: str
    margin: float | None
    reason: str
    checks: str = ""


class Store:
    """The drives of the study ``name``, by any number of workers. ``key`` is what all of them have in common."""

    def __init__(self, place: str, name: str, key: str) -> None:
        import optuna
        from sqlalchemy.exc import SQLAlchemyError

        optuna.logging.set_verbosity(optuna.logging.ERROR)
        self._errors = (optuna.exceptions.OptunaError, SQLAlchemyError, ImportError, OSError, ValueError)
        self._shown = masked(place)
        # the same number is another process in another container
        self._worker, self._process = f"{socket.gethostname()} {Path('/proc/self/ns/pid').readlink()}", os.getpid()
        self._drives: dict[str, Drive] = {}
        self._claims: dict[str, int] = {}
        self._ended = 0
        self._seen: dict[int, float] = {}
        with self._told():
            self._storage = _opened(place)
            study = optuna.create_study(study_name=name, storage=self._storage, load_if_exists=True)
            self._study = self._storage.get_study_id_from_name(name)
            if "key" not in study.user_attrs:
                study.set_user_attr("key", key)
            found = study.user_attrs["key"]
        if found != key:
            raise OtherSearch(
                f"'{self._shown}' is of another test, application, range or seed: name another folder with --report, "
                "or another study with --study, or remove it"
            )

    def get(self, values: Mapping[str, str]) -> Drive | None:
        return self.known([values])[0]

    def known(self, points: Sequence[Mapping[str, str]]) -> Sequence[Drive | None]:
        names = [point_text(values) for values in points]
        if any(name not in self._drives for name in names):
            self._unended()
        return [self._drives.get(name) for name in names]

    def claim(self, values: Mapping[str, str]) -> int | None:
        """A separate number for a drive at these values; None if another worker makes it, or has made it."""
        from optuna.trial import TrialState, create_trial

        name = point_text(values)
        if self._is_taken(name):
            return None
        about = {"point": name, "worker": self._worker, "process": self._process}
        with self._told():
            trial = create_trial(state=TrialState.RUNNING, user_attrs=about)
            self._claims[name] = self._storage.create_new_trial(self._study, trial)
            number = self._storage.get_trial_number_from_id(self._claims[name])
        if self._is_taken(name):
            self._end(self._claims.pop(name))
            return None
        return number

    def _is_taken(self, name: str) -> bool:
        """By a drive, or by another's claim that is older than one of this worker."""
        claims = [trial for trial in self._unended() if trial.user_attrs.get("point") == name and self._lives(trial)]
        return name in self._drives or any(trial._trial_id != self._claims.get(name) for trial in claims[:1])

    def _lives(self, trial: "FrozenTrial") -> bool:
        """Whether the worker of a claim may still drive."""
        if trial._trial_id in self._claims.values():
            return True
        about = trial.user_attrs
        if about.get("worker") == self._worker and not Path(f"/proc/{about['process']}").exists():
            return False
        now = time.monotonic()
        return now - self._seen.setdefault(trial.number, now) < PATIENCE_S

    def add(self, drive: Drive) -> None:
        """Keeps a drive and ends its claim; the first one at some values stays."""
        name = point_text(drive.values)
        trial = self._claims.pop(name)
        about = {"number": drive.number, "outcome": drive.outcome, "reason": drive.reason, "checks": drive.checks}
        with self._told():
            self._storage.set_trial_user_attr(trial, "drive", about | {"margin": drive.margin})
        self._end(trial, drive.margin)

    def _end(self, trial: int, margin: float | None = None) -> None:
        from optuna.trial import TrialState

        state, values = (TrialState.FAIL, None) if margin is None else (TrialState.COMPLETE, [margin])
        with self._told():
            self._storage.set_trial_state_values(trial, state, values)

    def _unended(self) -> "list[FrozenTrial]":
        """The claims, after drives that were added meanwhile have been read."""
        with self._told():
            trials = self._storage.get_all_trials(self._study, deepcopy=False)[self._ended :]
        for trial in trials:
            about = trial.user_attrs
            if "drive" in about:
                self._drives.setdefault(about["point"], Drive(values=json.loads(about["point"]), **about["drive"]))
        running = [trial for trial in trials if not trial.state.is_finished()]
        self._ended = running[0].number if running else self._ended + len(trials)
        return running

    def wait(self) -> None:
        """Returns when others may have got on."""
        time.sleep(_PAUSE_S)

    def close(self) -> None:
        """Gives up what is claimed."""
        while self._claims:
            with contextlib.suppress(StorageProblem):
                self._end(self._claims.popitem()[1])
        self._storage.remove_session()

    @contextlib.contextmanager
    def _told(self) -> Iterator[None]:
        try:
            yield
        except self._errors as error:
            cause = error.__cause__ or error
            said = masked(" ".join(str(getattr(cause, "orig", cause)).split()))
            hint = "; a password is taken from PGPASSWORD or ~/.pgpass" if "password" in said else ""
            raise StorageProblem(f"'{self._shown}' cannot be used: {said}{hint}") from None


def _opened(place: str) -> "BaseStorage":
    from optuna.storages import JournalStorage, RDBStorage, get_storage
    from optuna.storages.journal import JournalFileBackend, JournalFileSymlinkLock
    from sqlalchemy.exc import ArgumentError, DBAPIError

    if SCHEME not in place:
        if not place:
            raise OtherSearch(f"--storage is empty, {_EXPECTED}")
        Path(place).parent.mkdir(parents=True, exist_ok=True)
        lock = JournalFileSymlinkLock(place)
        _mend(Path(place), lock)
        return JournalStorage(JournalFileBackend(place, lock))
    address = _POSTGRES.sub("postgresql+psycopg", place)
    try:
        storage = RDBStorage(address, engine_kwargs={"pool_pre_ping": True})
    except (ArgumentError, ValueError):
        raise OtherSearch(f"the address after --storage cannot be read, {_EXPECTED}") from None
    except DBAPIError:  # another worker makes the tables
        time.sleep(_TABLES_S)
        storage = RDBStorage(address, engine_kwargs={"pool_pre_ping": True})
    return get_storage(storage)


def _mend(path: Path, lock: Any) -> None:
    """Cuts off a last line that a power cut left unfinished."""
    lock.acquire()
    try:
        written = path.read_bytes() if path.exists() else b""
        if not written.endswith(b"\n") and written:
            os.truncate(path, written.rfind(b"\n") + 1)
    finally:
        lock.release()


@contextlib.contextmanager
def opened(place: str, name: str, key: str) -> Iterator[Store]:
    store = Store(place, name, key)
    try:
        yield store
    finally:
        store.close()


def point_text(values: Mapping[str, str]) -> str:
    """What names a drive."""
    return json.dumps(dict(sorted(values.items())), ensure_ascii=False)
