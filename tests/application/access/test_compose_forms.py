"""Every form of every key: kept, rewritten, removed or refused, as the tables say, and as compose sees the copy."""

import json
import subprocess
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
import yaml

from dodo_dsl.application.access import compose_keys
from dodo_dsl.application.access.compose_keys import removed
from dodo_dsl.application.access.findings import CompiledTest, compiled_findings
from dodo_dsl.application.access.host_paths import HostPaths
from dodo_dsl.application.access.model import Access, mappings, shown
from dodo_dsl.application.access.value_findings import OWN_VOLUMES
from dodo_dsl.application.model import FILES, SANDBOX
from dodo_dsl.application.read import read_application
from dodo_dsl.diagnostics import Diagnostic
from dodo_dsl.plan.model import Application
from dodo_dsl.plan.rewrite.rewrite import plan_application
from dodo_dsl.plan.rewrite.service_copy import Setting
from tests.application.access import compose_forms
from tests.application.access.compose_forms import Form, forms, schema
from tests.emit.readers import compose

ROWS = {
    "service": compose_keys.SERVICE,
    "volume": compose_keys.VOLUME,
    "network": compose_keys.NETWORK,
    "secret": compose_keys.SECRET,
    "config": compose_keys.CONFIG,
}
PRIVILEGED = tuple(f"list of privileged: {word}" for word in ("true", "string 'true", "string 'TRUE", "string 'yes"))
REFUSED = {
    "service.build": ("entitlements: ",),
    "service.memswap_limit": ("string '-1'",),  # by compose, too
    **dict.fromkeys(("service.post_start", "service.pre_stop"), PRIVILEGED),
    "service.volumes": ("list of type: cluster", "list of type: npipe", "list of bind: recursive: writable"),
    "volume.driver_opts": ("",),
}
"""How the forms begin that are refused for their values, of keys that are not."""
HARMLESS = ("service.use_api_socket false", "secret.external false", "config.external false")
"""Forms of refused keys that ask for nothing."""
TOO_NEW: tuple[str, ...] = (
    *(f"service.build {key}: " for key in ("no_cache_filter", "provenance", "sbom")),
    *(f"service.build additional_contexts: a: {word}" for word in ("false", "null", "number", "true")),
    *(f"service.build ulimits: nofile: {word}string " for word in ("", "hard: ", "soft: ")),
    "service.blkio_config weight: string ",
    "service.blkio_config weight_device: list of weight: string ",
    "service.build secrets: list of mode: string ",
    "service.env_file list of format: ",
    "service.umask",
    "service.volumes list of image: ",
    "service.volumes list of tmpfs: mode: string ",
)
"""How the forms begin that not every compose knows, or on which some break."""


@dataclass(frozen=True)
class Case:
    """A form of a key of one of the tables."""

    table: str
    key: str
    form: Form
    number: int

    @property
    def name(self) -> str:
        return f"{self.table}.{self.key} {self.form.label}"

    @property
    def treatment(self) -> str:
        """What becomes of the form; 'nothing' of one that asks for nothing."""
        words = REFUSED.get(f"{self.table}.{self.key}", ())
        if any(self.form.label.startswith(word) for word in words):
            return "refused"
        treatment = ROWS[self.table][self.key].treatment
        return "nothing" if self.name.replace("string 'false'", "false") in HARMLESS else treatment

    @property
    def service(self) -> str:
        return f"a{self.number}"

    def add(self, document: dict[str, Any]) -> None:
        """Adds the form to a compose file."""
        service: dict[str, Any] = {"image": "team/a", "command": "--cid=111"}
        if self.table == "service":
            service[self.key] = self.form.value
        else:
            entry = f"{self.table[0]}{self.number}"
            has_content = self.key in ("content", "environment") or self.table not in ("config", "secret")
            needed = {} if has_content else {"file": "./a.env"}
            document[f"{self.table}s"][entry] = {**needed, self.key: self.form.value}
            service[f"{self.table}s"] = [f"{entry}:/v:ro" if self.table == "volume" else entry]
        document["services"][self.service] = service

    def of_copy(self, copy: Mapping[str, Any]) -> Mapping[str, Any]:
        """The mapping of a test's copy that had the key."""
        name = self.service if self.table == "service" else f"{self.table[0]}{self.number}"
        found: Mapping[str, Any] = copy.get(f"{self.table}s", {}).get(name)
        return found or {}


def cases() -> Iterator[Case]:
    number = 0
    for table in ROWS:
        definitions = ("container_spec", "workload_spec", "service") if table == "service" else (table,)
        for definition in definitions:
            for key, node in schema()["$defs"][definition]["properties"].items():
                every = forms(node, f"{table}.{key}") if key != "pre_start" else [Form("list", [{"command": "x"}])]
                for form in every:
                    number += 1
                    yield Case(table, key, form, number)


CASES: dict[str, list[Case]] = {}
for _case in cases():
    CASES.setdefault(f"{_case.table}.{_case.key}", []).append(_case)


@pytest.fixture
def repository(tmp_path: Path) -> Path:
    folder = tmp_path / "team"
    for name, text in {**compose_forms.FILES, "dodo.yml": "dodo: 1\n"}.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)
    return folder


def compiled(written: list[Case], folder: Path, hil: bool = False) -> tuple[Application | None, list[Diagnostic]]:
    """The forms as one application, a service each."""
    document: dict[str, Any] = {
        "services": {"b": {"image": "team/b"}},
        "volumes": {"vol": {}},
        "secrets": {"s": {"file": "./a.env"}},
        "configs": {"c": {"file": "./a.env"}},
        "networks": {"a": {}, "n": {}},
    }
    for case in written:
        case.add(document)
    file = folder / "docker-compose.yml"
    file.write_text(yaml.safe_dump(document, sort_keys=False))
    source, problems = read_application(file)
    if source is None:
        return None, problems
    place = folder.parent / "generated" / "t"
    setting = Setting(140, "network", place, hil=hil, privileged_allowed=hil)
    return plan_application(source, setting), problems


@pytest.mark.thorough
@pytest.mark.parametrize("key", CASES)
def test_what_becomes_of_each_form(key: str, repository: Path) -> None:
    refused = [case for case in CASES[key] if case.treatment == "refused"]
    for case in refused:
        application, problems = compiled([case], repository)
        assert application is None, case.name
        lines = (repository / "docker-compose.yml").read_text().splitlines()
        first = next(n for n, line in enumerate(lines, 1) if line.strip().startswith(f"{case.key}:"))
        errors = [problem for problem in problems if problem.severity == "error"]
        assert [e for e in errors if e.span.line >= first], case.name
    taken = [case for case in CASES[key] if case.treatment != "refused"]
    application, problems = compiled(taken, repository)
    assert application is not None, [str(problem) for problem in problems if problem.severity == "error"]
    for case in taken:
        copy = case.of_copy(application.compose)
        assert case.treatment != "removed" or case.key not in copy, case.name
        assert case.treatment != "kept" or copy.get(case.key) == case.form.value, case.name
        left = list(left_below(copy)) if case.table == "service" else []
        assert left == [], case.name


def left_below(service: Mapping[str, Any]) -> Iterator[str]:
    """Keys of a service's copy, below its own, that the tables say are removed."""
    for path, rows in compose_keys.BELOW.items():
        for _, mapping in mappings(dict(service), path):
            yield from (f"{path}.{key}" for key, value in mapping.items() if value and key in removed(rows))


@pytest.mark.thorough
@pytest.mark.parametrize("key", [f"{table}.{key}" for table, rows in ROWS.items() for key in rows])
def test_no_key_has_another_case(key: str, repository: Path) -> None:
    """Compose knows keys in lower case only, and DoDo takes no other for granted."""
    case = CASES[key][0]
    upper = Case(case.table, case.key.upper(), case.form, 1)
    application, problems = compiled([upper], repository)
    assert application is None
    (told,) = [problem for problem in problems if problem.rule == "unknown-key"]
    assert told.hint == f"did you mean '{case.key}'?"
    line = (repository / "docker-compose.yml").read_text().splitlines()[told.span.line - 1]
    assert line.strip().startswith(upper.key)


@pytest.mark.slow
@pytest.mark.parametrize("hil", [False, pytest.param(True, marks=pytest.mark.proof)])
def test_what_compose_makes_of_the_copies(hil: bool, repository: Path) -> None:
    """All copies in one file: compose takes it, and shows nothing that is removed or refused."""
    known = [case for of_key in CASES.values() for case in of_key if not case.name.startswith(TOO_NEW)]
    whole: dict[str, Any] = {}
    for key in dict.fromkeys(f"{case.table}.{case.key}" for case in known):
        taken = [case for case in CASES[key] if case in known and case.treatment != "refused"]
        application, _ = compiled(taken, repository, hil) if taken else (None, [])
        for name, entries in application.compose.items() if application else ():
            whole.setdefault(name, {}).update(entries)
    own = {"image": "dodo/sandbox:1", "healthcheck": {"test": ["CMD", "true"]}}
    whole["services"] |= {SANDBOX: own, FILES: own}
    whole["volumes"] |= {name: {} for name in OWN_VOLUMES}
    folder = repository.parent / "generated" / "t"
    folder.mkdir(parents=True)
    (folder / "compose.yml").write_text(yaml.safe_dump(whole))
    command = [*compose(), "-f", "compose.yml", "config", "--format", "json"]
    said = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert said.returncode == 0, said.stderr
    config = json.loads(said.stdout)
    shown_services = config["services"]
    for case in known:
        if case.table == "service" and case.treatment == "removed":
            assert not shown_services.get(case.service, {}).get(case.key), case.name
    for name, service in shown_services.items():
        assert list(left_below(service)) == [], name
    paths = HostPaths(folder, (repository,), tmp=False)
    names = [name for name in shown_services if name not in (SANDBOX, FILES)]
    access = Access(devices=hil, privileged=hil)
    test = CompiledTest(names, [SANDBOX], ["dodo/sandbox:1"], True, access, paths)
    found = [f"{shown(finding.steps)}: {finding.message}" for finding in compiled_findings(config, test)]
    assert not found, "\n".join(found)
