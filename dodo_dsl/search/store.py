"""The drives of a study by their values, kept by Optuna: in a journal file, or in a database that workers share.

A drive is a trial that has ended. Workers may make the same one at once; the first of them counts.
"""

import contextlib
import json
import re
import socket
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from optuna.storages import BaseStorage

SCHEME = "://"
_POSTGRES = re.compile(r"postgres(ql)?(?=://)")
_PASSWORD = re.compile(r"(:/+[^/@:\s]*):.*@", re.DOTALL)
_PARAMETER = re.compile(r"([?&](?:ssl)?password=)[^&\s'\"]*")
_EXPECTED = "expected the path of a file, or an address as postgresql://USER@HOST/DATABASE"
_TABLES_S = 2.0


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
    """What became of a test at some values; ``number`` is its place in the course.

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
        self._drives: dict[str, Drive] = {}
        self._read = 0
        with self._told():
            self._storage = _opened(place)
            self._study = optuna.create_study(study_name=name, storage=self._storage, load_if_exists=True)
            if "key" not in self._study.user_attrs:
                self._study.set_user_attr("key", key)
            found = self._study.user_attrs["key"]
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
            with self._told():
                trials = self._study.get_trials(deepcopy=False)[self._read :]
            self._read += len(trials)
            for about in (trial.user_attrs for trial in trials if "drive" in trial.user_attrs):
                self._drives.setdefault(about["point"], Drive(values=json.loads(about["point"]), **about["drive"]))
        return [self._drives.get(name) for name in names]

    def add(self, drive: Drive) -> None:
        """Keeps a drive."""
        from optuna.trial import TrialState, create_trial

        about = {"number": drive.number, "outcome": drive.outcome, "reason": drive.reason, "checks": drive.checks}
        trial = create_trial(
            state=TrialState.FAIL if drive.margin is None else TrialState.COMPLETE,
            value=drive.margin,
            user_attrs={
                "point": point_text(drive.values),
                "drive": about | {"margin": drive.margin},
                "worker": socket.gethostname(),
            },
        )
        with self._told():
            self._study.add_trial(trial)

    def close(self) -> None:
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
        return JournalStorage(JournalFileBackend(place, JournalFileSymlinkLock(place)))
    address = _POSTGRES.sub("postgresql+psycopg", place)
    try:
        storage = RDBStorage(address, engine_kwargs={"pool_pre_ping": True})
    except (ArgumentError, ValueError):
        raise OtherSearch(f"the address after --storage cannot be read, {_EXPECTED}") from None
    except DBAPIError:  # another worker makes the tables
        time.sleep(_TABLES_S)
        storage = RDBStorage(address, engine_kwargs={"pool_pre_ping": True})
    return get_storage(storage)


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
