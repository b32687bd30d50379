"""Applications through the whole compiler: compose files as a repository has them, and as a test runs them."""

import functools
import json
import os
import re
import shlex
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from dodo_dsl import compiler
from dodo_dsl.application.interpolation import dotenv, interpolate, mapped_texts
from dodo_dsl.diagnostics import Diagnostic, forget_lines
from dodo_dsl.emit.render import render_plan
from dodo_dsl.plan.model import Plan
from dodo_dsl.spec.load import Settings
from tests.check.examples import FILES, SPEC

WAYS = ("network", "host", "hil")
"""The tests of a repository: isolated, on the host's network, and on a rig that allows privileges."""
CID = 140
SERIAL = "/dev/ttyACM7"
"""The rig's port."""
FILE = "docker-compose.yml"
_RIG = {"kind": "dynamic", "cid": CID, "serial": SERIAL, "camera": {"source": "rpicam"}, "privileged": True}
_DEPLOYMENT = {"dodo": 1, "registry": ["tests"], "application": FILE, "cids": f"{CID}-149"}
_HOME = str(Path.home())
_DEPTH = 2
"""Of the keys of services, and of what volumes, secrets and configs have."""
_HIL = (
    ("level: sil", "level: hil\nrig: bench"),
    ("uses: virtual-camera", "uses: camera"),
    ("uses: integrator", "uses: gantry, with: {x: 0 m, y: 0 m, yaw: 0 deg}"),
    ("60 s", "120 s"),
)


@dataclass(frozen=True)
class Told:
    """A diagnostic: its place is what a test asserts, its sentence is for the reader of a failure."""

    rule: str
    severity: str
    file: str
    line: int
    column: int
    text: str


@dataclass(frozen=True)
class Compiled:
    """A compiled test; ``files`` are empty and ``plan`` is None where there are errors."""

    folder: Path
    told: tuple[Told, ...]
    files: Mapping[str, str]
    plan: Plan | None

    @property
    def errors(self) -> list[Told]:
        return [told for told in self.told if told.severity == "error"]

    @functools.cached_property
    def document(self) -> dict[str, Any]:
        """The compiled ``application.compose.yml`` as compose reads it, with the variables of the test's ``.env``."""
        assert self.files, self.told
        found = yaml.safe_load(self.files["application.compose.yml"])
        variables = {"HOME": _HOME, **_dotenv(self.files[".env"])}
        made: dict[str, Any] = filled(found, variables)
        for service in made["services"].values():
            for part in (service, service.get("build")):
                for key in ("environment", "args") if isinstance(part, dict) else ():
                    if key in part:
                        pairs = _uniform(key, part[key], self.folder).items()
                        known = {name: variables.get(name) if value is None else value for name, value in pairs}
                        part[key] = {name: value for name, value in known.items() if value is not None}
        return made

    @functools.cached_property
    def services(self) -> dict[str, Any]:
        """The services in one form of each key: see ``uniform``."""
        return {name: uniform(service, self.folder) for name, service in self.document["services"].items()}

    def write(self) -> Path:
        """Writes the compiled test, and returns its folder."""
        self.folder.mkdir(parents=True, exist_ok=True)
        for name, text in self.files.items():
            (self.folder / name).write_text(text)
        return self.folder


def repository(folder: Path, files: Mapping[str, str] = {}) -> Path:
    """A repository with three tests, and the ``files`` of an application."""
    root = folder / "team"
    spec = SPEC.replace("../maps", "maps").replace("  camera:", "  scene:")
    specs = {
        "network": spec,
        "host": spec.replace("level: sil", "level: sil\nisolation: host"),
        "hil": spec,
    }
    for old, new in _HIL:
        specs["hil"] = specs["hil"].replace(old, new)
    texts = {f"tests/{way}.dodo.yml": text.replace("name: example", f"name: {way}") for way, text in specs.items()}
    texts["tests/maps/plain/map.json"] = FILES["tests/maps/plain/map.json"]
    for name, text in {**texts, **files}.items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_bytes(text.encode())
    (root / ".git").mkdir(exist_ok=True)
    return root


def compiled(
    root: Path,
    document: str | Mapping[str, Any] | None = None,
    way: str = "network",
    settings: Settings = Settings(),  # noqa: B008  (it is frozen)
    **deployment: Any,
) -> Compiled:
    """A test of a repository with a compose file, and with what ``deployment`` says beside it in ``dodo.yml``."""
    if document is not None:
        (root / FILE).write_text(document if isinstance(document, str) else written(document))
    rigs = {"rigs": {"bench": _RIG}} if way == "hil" else {}
    (root / "dodo.yml").write_text(written({**_DEPLOYMENT, **rigs, **deployment}))
    forget_lines()
    out = root / "generated"
    checked = compiler.load([root / "tests" / f"{way}.dodo.yml"], settings=settings, start=root)
    if not checked.ok:
        return Compiled(out / way, tuple(_told(checked.diagnostics, root)), {}, None)
    made = compiler.plan(checked, out)
    (plan,) = made.compiled.suite.plans
    told = tuple(_told([*checked.diagnostics, *made.problems], root))
    if any(one.severity == "error" for one in told):
        return Compiled(out / way, told, {}, None)
    return Compiled(out / way, told, {Path(f.path).name: f.text for f in render_plan(plan)}, plan)


def written(document: Mapping[str, Any]) -> str:
    """A document with a line for each key of a service, so that the line of a place says whose it is."""
    return "".join(f"{line}\n" for line in _lines(document, 0))


def _lines(mapping: Mapping[str, Any], depth: int) -> Iterator[str]:
    for key, value in mapping.items():
        if isinstance(value, Mapping) and value and depth < _DEPTH:
            yield f"{'  ' * depth}{json.dumps(key)}:"
            yield from _lines(value, depth + 1)
        else:
            yield f"{'  ' * depth}{json.dumps(key)}: {json.dumps(value)}"


def _told(diagnostics: Sequence[Diagnostic], root: Path) -> Iterator[Told]:
    for one in diagnostics:
        place = Path(one.span.file)
        file = str(place.relative_to(root)) if place.is_relative_to(root) else str(place)
        yield Told(one.rule, one.severity, file, one.span.line, one.span.column, f"{one.message}; {one.hint}")


def filled(value: Any, variables: Mapping[str, str]) -> Any:
    """A value with its variables filled in, as compose does it: merging.yml says how, and compose is asked there."""
    return mapped_texts(value, lambda text: interpolate(text, variables))


def _dotenv(text: str) -> dict[str, str]:
    """The variables of a compiled test's ``.env``."""
    found: dict[str, str] = {}
    for name, value in dotenv(text)[0]:
        found[name] = interpolate(value or "", found)
    return found


_SIZES = ("mem_limit", "memswap_limit", "mem_reservation", "shm_size", "size", "memory")
_UNITS = {"": 1, "b": 1, "k": 1 << 10, "m": 1 << 20, "g": 1 << 30, "t": 1 << 40}
_MAPPINGS = ("environment", "args", "labels", "sysctls", "annotations", "additional_contexts")
_LISTS = ("dns", "dns_search", "tmpfs", "env_file", "label_file")


def size(value: Any) -> int:
    """Bytes of a size as compose writes it: a number, perhaps with a unit of 1024; raises ValueError for others."""
    found = re.fullmatch(r"\s*(-?[0-9.eE+]+?)\s*([kmgtb]?)(?:i?b)?\s*", str(value).lower())
    if found is None:
        raise ValueError(value)
    return int(float(found[1]) * _UNITS[found[2]])


def uniform(service: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """The service in one form of each key: scalars as text, long forms where there are, bytes, and no null.

    Paths, which are relative to ``folder``, are as seen from the repository, where they lie in it.
    """
    return {key: _uniform(key, value, folder) for key, value in service.items() if value is not None}


def _uniform(key: str, value: Any, folder: Path) -> Any:
    if key in _SIZES and value is not None:
        return str(size(value))
    if key in ("command", "entrypoint") and isinstance(value, str):
        return shlex.split(value)
    if key == "test" and isinstance(value, str):
        return ["CMD-SHELL", value]
    if key == "file":
        return of_repository(str(value), folder)
    if key == "build":
        return _build({"context": value} if isinstance(value, str) else value, folder)
    if key in _MAPPINGS and isinstance(value, list):
        return {name: word if equals else None for name, equals, word in (str(i).partition("=") for i in value)}
    if key in ("depends_on", "networks") and isinstance(value, list):
        value = dict.fromkeys(value, {"condition": "service_started"} if key == "depends_on" else None)
    if key == "depends_on":
        value = {
            name: {k: v for k, v in about.items() if (k, v) != ("required", True)} for name, about in value.items()
        }
    if key == "extra_hosts":
        pairs = value.items() if isinstance(value, dict) else (re.split("[:=]", host, maxsplit=1) for host in value)
        return [f"{name}={address}" for name, address in pairs]
    if key in _LISTS and not isinstance(value, list):
        value = [value]
    if key == "volumes":
        return [_mount(each, folder) for each in value]
    if key == "env_file":
        return [_env_file(each, folder) for each in value]
    if key == "tmpfs" and isinstance(value, list):
        return [_tmpfs(str(each)) for each in value]
    if key in ("configs", "secrets") and isinstance(value, list):
        return [_plain(each if isinstance(each, dict) else {"source": each}, folder) for each in value]
    return _plain(value, folder)


def _plain(value: Any, folder: Path) -> Any:
    if isinstance(value, dict):
        return {key: _uniform(str(key), inner, folder) for key, inner in value.items()}
    if isinstance(value, list):
        return [_plain(inner, folder) for inner in value]
    return value if value is None else str(value).lower() if isinstance(value, bool) else str(value)


def _build(build: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    made = {key: _uniform(key, value, folder) for key, value in build.items() if value is not None}
    others = {name: of_repository(path, folder) for name, path in (made.get("additional_contexts") or {}).items()}
    if made.get("dockerfile") == "Dockerfile":
        del made["dockerfile"]
    own = {"context": of_repository(made.get("context", "."), folder)}
    return {**made, **own, **({"additional_contexts": others} if others else {})}


def _env_file(value: Any, folder: Path) -> dict[str, Any]:
    entry = {"path": value} if isinstance(value, str) else dict(value)
    entry["path"] = of_repository(entry["path"], folder)
    return {key: _plain(word, folder) for key, word in entry.items() if (key, word) != ("required", True)}


def _mount(value: Any, folder: Path) -> str:
    """The short form of a mount, with its options in order; what only a long form can say comes last."""
    if isinstance(value, str):
        source, *rest = value.rsplit(":", value.count(":")) if ":" in value else ("", value)
        target, options = rest[0], ",".join(rest[1:])
        words = {word for word in options.split(",") if word and word != "rw"}
    else:
        source, target, words = str(value.get("source") or ""), value["target"], set()
        words |= {"ro"} if value.get("read_only") else set()
        for kind, about in value.items():
            if kind in ("bind", "volume", "tmpfs", "image") and isinstance(about, dict):
                words |= {_word(*pair) for pair in about.items() if pair not in (("create_host_path", True),)}
        words |= {value["type"]} if value.get("type") not in ("bind", "volume") else set()
    source = of_repository(source, folder) if source.startswith((".", "/", "~")) else source
    return ":".join(part for part in (source, target, ",".join(sorted(words))) if part)


def _tmpfs(text: str) -> str:
    target, _, options = text.partition(":")
    words = (word.partition("=") for word in options.split(",") if word)
    made = sorted(
        f"size={size(value)}" if key == "size" and "%" not in value else f"{key}{_}{value}" for key, _, value in words
    )
    return ":".join([target, *([",".join(made)] if made else [])])


def _word(key: str, value: Any) -> str:
    if key == "size":
        return f"size={size(value)}"
    return key if value is True else str(value) if key == "selinux" else f"{key}={value}"


def of_repository(path: str, folder: Path) -> str:
    """A path as seen from the repository, which is ``folder`` or where the compiled test of that folder lies."""
    if "://" in path or path.startswith(("~", "git@", "service:")) or not path:
        return path
    root = folder if (folder / "dodo.yml").is_file() else folder.parents[1]
    place = Path(os.path.normpath(folder / path))
    if place == root:
        return "."
    if place.is_relative_to(_HOME) and not root.is_relative_to(_HOME):
        return f"~/{place.relative_to(_HOME)}"
    return f"./{place.relative_to(root)}" if place.is_relative_to(root) else str(place)
