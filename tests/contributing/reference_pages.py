"""The pages of ``dodo.yml``, ``results.json``, applications and environment variables, made of schemas and code."""

import json
import re
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Any

import yaml

from dodo_dsl.application import container

Schema = Mapping[str, Any]

ROOT = Path(__file__).parents[2]
REFERENCE = ROOT / "docs" / "reference"
DEPLOYMENT = """# dodo.yml

The file at the root of a repository that says where its tests are and what they test. Every key but `dodo` is optional:

```yaml
dodo: 1
registry: [tests, "dodo:"]         # your own tests, and those that ship with DoDo
application: docker-compose.yml    # what is tested
services: [my_services]            # services of your own
messages: [my.odvd]                # messages of your own
sandbox: {memory: 4 GB}            # what the application may use
```

More on [`application`](applications.md#with-nothing-of-dodo-in-your-compose-file), on [`sandbox`, `paths` and
`environment`](sandbox.md) and on [`rigs`](../how-to/rigs.md). `scripts/make-reference` writes this page from
`schemas/deployment.schema.json`.
"""
RESULTS = """# results.json

What `dodo run` writes into the report for programs to read: one object, with an entry in `tests` for each test. Ignore
keys that you do not know; `version` grows when one is removed or changes its meaning ([promise](versions.md)). What the
[report's page](report.md) shows is this file:

```text
jq -r '.tests[] | [.outcome, .name, .reason] | @tsv' dodo-report/results.json
```

`scripts/make-reference` writes this page from `schemas/results.schema.json`.
"""
VARIABLES = """# Environment variables

What you may set for DoDo, and what DoDo sets for the programs of a test. Variables for the application are in
[the sandbox](sandbox.md#variables-and-secrets). `scripts/make-reference` writes this page, and fails if the code has
a variable that is missing here.
"""
SETTINGS = {
    "DODO_DEBUG": "`1` shows the traceback of an internal error",
    "DODO_FIRMWARE": "the folder of the emulated rig, with `rig-emulator` and `gantry.elf`; "
    "default `build/firmware` in the checkout, then `/opt/dodo/firmware`",
    "DODO_HISTORY": "the file with the durations of earlier runs; default `~/.local/state/dodo/history.jsonl`",
    "DODO_IMAGE_<SERVICE>": "the image of a service of the application, in place of that of its compose file; "
    "its name in capitals, with `_` for other characters",
    "DODO_LEASES": "the folder for leases of CIDs, rigs and devices, if root made no `/var/lib/dodo/leases`; "
    "default `/run/lock/dodo-UID`, else `/tmp/dodo-UID`",
    "DODO_RIGS": "the folder for quarantines of rigs, if root made no `/var/lib/dodo/rigs`; "
    "default `~/.local/state/dodo/rigs`",
    "DODO_SUBNET": "the network of a compiled test in containers, in place of the planned one",
    "COLUMNS": "how wide lines of files are shown; default the terminal's width",
    "DOCKER_HOST": "the Docker engine, with `DOCKER_TLS_VERIFY` and `DOCKER_CERT_PATH` as for docker itself",
    "FORCE_COLOR": "`1` switches colours on, as in a CI log",
    "NO_COLOR": "`1` switches colours off",
    "XDG_CACHE_HOME": "where DoDo keeps wheels, compiled templates and small programs; default `~/.cache`",
    "XDG_STATE_HOME": "where DoDo keeps durations and quarantines; default `~/.local/state`",
}
PIPELINES = {
    "DODO_API_TOKEN": "token by which `dodo report --gitlab` fetches the reports of child pipelines",
    "DODO_COMPILE_OPTIONS": "further options of `dodo compile`",
    "DODO_RUN_OPTIONS": "options of `dodo run` in every test, in place of the input `run-options`",
    "DODO_SEARCH_STORAGE": "address of the database of searches; its password is `PGPASSWORD`",
    "DODO_PARENT_PIPELINE_ID": "of a child pipeline: the pipeline whose job `dodo-compile` has its tests",
}
INPUTS = {
    "DODO_BUILD", "DODO_COMPOSE_FILE", "DODO_DOWNSTREAM", "DODO_DOWNSTREAM_BRANCH", "DODO_PLATFORMS", "DODO_TESTS",
    "DODO_TEST_BEFORE_SCRIPT", "DODO_TEST_IMAGE", "DODO_TEST_OPTIONS", "DODO_TEST_SERVICES", "DODO_TEST_TAGS",
}  # fmt: skip
"""What templates for GitLab hand from an input to a job: set the input."""
SERVICES = {
    "DODO_CHANNEL": "the folder where services meet, each by a link of its name; no application has it",
    "DODO_CLOCK": "`lockstep`, or `recording` for `dodo judge`; without it real time",
    "DODO_ODVD": "files of further messages, separated by `:`",
    "DODO_ANSWERS": "not empty where the application keeps the machine's time, so that the clock waits for its answers",
    "DODO_READERS": "processes of the application that wait for each frame",
    "DODO_RECORDING": "the recording that is judged again",
    "DODO_RIG": "the rig on which the test runs",
    "DODO_RUNNER": "empty if there is no runner, as with `docker compose up`",
    "DODO_SENDERS": "which service may send which message",
    "DODO_SERVICE": "the service's name in the test",
    "DODO_SLOT": "the test's slot, by which what it left behind is found",
    "DODO_TIME": "of the application: the folder through which its programs get the test's time",
    "DODO_TIME_SERVICE": "of the application: the number of the service for the same",
    "DODO_TOLD": "messages of the simulation that the application declares to take",
    "DODO_TRUTH": "messages by which evaluators judge",
    "DODO_WORLD": "the services that hear what only a simulation knows",
}
_OTHERS = {"DODO_BASE"}  # an argument of image builds
_ALWAYS = {name for name in SETTINGS if not re.fullmatch(r"DODO_[A-Z_]+", name)}
"""What a search for ``DODO_...`` does not find; of the others the page has those of the code."""


def used() -> set[str]:
    """The variables ``DODO_...`` in the code that ships."""
    files = [path for folder in ("dodo_dsl", "services", "templates") for path in (ROOT / folder).rglob("*")]
    texts = (path.read_text() for path in files if path.suffix in (".py", ".j2", ".yml"))
    found = {name for text in texts for name in re.findall(r"\bDODO_[A-Z_]*[A-Z]\b", text)}
    return {name for name in found if not name.startswith("DODO_IMAGE")}


def environment() -> str:
    tables = {
        "What you may set": SETTINGS,
        "In pipelines": PIPELINES,
        "What services of a test get": SERVICES,
    }
    known = {*SETTINGS, *PIPELINES, *SERVICES, *INPUTS, *_OTHERS}
    found = used()
    assert found <= known, f"describe {found - known} in {Path(__file__).name}"
    told = "".join(
        f"\n## {title}\n\n| variable | says |\n|---|---|\n"
        + "".join(f"| `{k}` | {v} |\n" for k, v in rows.items() if k in found or k in _ALWAYS)
        for title, rows in tables.items()
    )
    inputs = ", ".join(f"`{name}`" for name in sorted(INPUTS))
    said = f"Templates for GitLab hand inputs to jobs in {inputs}: set [the inputs](components.md)."
    return f"{VARIABLES}{told}\n{said}\n"


@cache
def schema(name: str) -> Schema:
    loaded: Schema = json.loads((ROOT / "schemas" / name).read_text())
    return loaded


def resolved(node: Schema, file: str) -> tuple[Schema, str]:
    """A node behind its ``$ref``, with its own description, and the file in which it stands."""
    if "anyOf" in node:
        first, where = resolved(node["anyOf"][0], file)
        types = {"type": [first["type"], *(other["type"] for other in node["anyOf"][1:])]}
        return {**first, **types, **{key: value for key, value in node.items() if key != "anyOf"}}, where
    if "$ref" not in node:
        return node, file
    place, _, path = node["$ref"].partition("#")
    target: Any = schema(place or file)
    for part in path.strip("/").split("/"):
        target = target[part]
    found, where = resolved(target, place or file)
    return {**found, **{key: value for key, value in node.items() if key != "$ref"}}, where


def of_dodo_yml() -> str:
    return DEPLOYMENT + "".join(
        sections(schema("deployment.schema.json"), "deployment.schema.json", ("default", "required"))
    )


def of_results() -> str:
    return RESULTS + "".join(sections(schema("results.schema.json"), "results.schema.json", ("there", "always")))


def sections(node: Schema, file: str, words: tuple[str, str], path: str = "") -> Iterator[str]:
    """The table of an object's keys, and then those of the objects below it.

    ``words`` are the title of the third column and what stands there for a required key.
    """
    required = node.get("required", ())
    below = []
    rows = ""
    for key, written in node["properties"].items():
        child, where = resolved(written, file)
        third = words[1] if key in required else default(child)
        rows += f"| `{key}` | {kind(child, where)} | {third} | {cell(child.get('description', ''))} |\n"
        for inner, suffix, inner_file in objects(child, where):
            below.append((inner, f"{path}{key}{suffix}", inner_file))
    title = f"## `{path.removesuffix('.')}`\n\n" if path else "## Keys\n\n"
    yield f"\n{title}| key | value | {words[0]} | says |\n|---|---|---|---|\n{rows}"
    for inner, name, inner_file in below:
        yield from sections(inner, inner_file, words, f"{name}.")


def objects(node: Schema, file: str) -> Iterator[tuple[Schema, str, str]]:
    """The objects with keys of their own in a value: itself, the items of a list, or the values of a mapping."""
    for candidate, suffix in ((node, ""), (node.get("items"), "[]"), (node.get("additionalProperties"), ".NAME")):
        if isinstance(candidate, Mapping):
            found, where = resolved(candidate, file)
            if "properties" in found:
                yield found, suffix, where


def kind(node: Schema, file: str) -> str:
    """What may stand behind a key, in words."""
    if "const" in node:
        return f"`{json.dumps(node['const'])}`"
    if "enum" in node:
        return ", ".join(f"`{value}`" for value in node["enum"])
    if "x-unit" in node:
        return f"quantity in {node['x-unit']}"
    types = node.get("type", "any value")
    words = [word for word in ([types] if isinstance(types, str) else types) if word != "null"]
    named = {
        "array": "list",
        "object": "mapping",
        "string": "text",
        "integer": "whole number",
        "boolean": "`true`, `false`",
    }
    said = " or ".join(named.get(word, word) for word in words)
    if "array" in words and isinstance(node.get("items"), Mapping):
        said = said.replace("list", f"list of {kind(resolved(node['items'], file)[0], file)}")
    nullable = " or null" if not isinstance(types, str) and "null" in types else ""
    return said + bounds(node) + nullable


def bounds(node: Schema) -> str:
    low, high = node.get("minimum", node.get("exclusiveMinimum")), node.get("maximum")
    if low is not None and high is not None:
        return f", {low} to {high}"
    return f", at least {low}" if low is not None else ""


def default(node: Schema) -> str:
    return f"`{yaml.safe_dump(node['default'], default_flow_style=True).splitlines()[0]}`" if "default" in node else ""


def cell(text: str) -> str:
    return text.replace("|", "\\|").replace("\n", " ")


def of_applications() -> str:
    """The page with the table of the keys of compose files made anew."""
    page = (REFERENCE / "sandbox.md").read_text()
    above, mark, rest = page.partition("<!-- keys, by scripts/make-reference -->\n")
    _, end, below = rest.partition("<!-- end of keys -->\n")
    made = [key for key in container._CARRIED if key not in container._AS_WRITTEN]
    rows = (
        (container._AS_WRITTEN, "as they are written"),
        (made, "made for the test, as the table above says"),
        (container._LEFT_OUT, "left out"),
        (container._REFUSED, "an error: something else would run, or on the host"),
    )
    table = "".join(f"| {', '.join(f'`{key}`' for key in sorted(keys))} | {what} |\n" for keys, what in rows)
    return f"{above}{mark}\n| keys of a service | in a test |\n|---|---|\n{table}\n{end}{below}"


PAGES = {
    REFERENCE / "sandbox.md": of_applications,
    REFERENCE / "deployment.md": of_dodo_yml,
    REFERENCE / "results.md": of_results,
    REFERENCE / "environment.md": environment,
}
