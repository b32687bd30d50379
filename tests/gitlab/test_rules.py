"""Which kinds of pipelines have DoDo's jobs: as a table for the documentation, and in files as teams write them."""

import functools
from collections.abc import Callable
from pathlib import Path

import pytest
import yaml

from tests.gitlab.inputs import TEMPLATES, Config, included, jobs, listed, merged, specified
from tests.gitlab.rules import KINDS

PAGE = Path(__file__).parents[2] / "docs/how-to/gitlab.md"
BEGIN, END = "<!-- the table is written by tests/gitlab/test_rules.py -->\n\n", "\n\n<!-- end of the table -->"
FOREIGN = {path.stem: path for path in sorted((Path(__file__).parent / "foreign").glob("*.yml"))}
WORKFLOW = yaml.safe_load(FOREIGN["workflow"].read_text())["workflow"]
COLUMNS: dict[str, tuple[str, Config]] = {
    "`joined`": ("joined", {}),
    "`joined`, and a [workflow](#one-pipeline-for-both)": ("joined", {"workflow": WORKFLOW}),
    "`merge-requests`": ("merge-requests", {}),
    "`branches`": ("branches", {}),
    "`tags`": ("tags", {}),
    "`schedules`": ("schedules", {}),
}


def table() -> str:
    rows = [("a pipeline of this kind tests", *COLUMNS), ("---",) * (len(COLUMNS) + 1)]
    for kind in KINDS:
        rows.append((kind, *("yes" if _tests(kind, *column) else "–" for column in COLUMNS.values())))
    return "\n".join(f"| {' | '.join(row)} |" for row in rows)


def _tests(kind: str, rules: str, around: Config) -> bool:
    """Whether all of DoDo's jobs are there, or none of them is: the same for each template."""
    found = set()
    for template in TEMPLATES:
        config = merged(included(template, rules=rules), around)
        there, every = listed(config, KINDS[kind]), jobs(config).keys() - {"dodo-deployment"}
        assert there in (set(), every), "a part of the jobs would test nothing, and be green"
        found.add(bool(there))
    (tests,) = found
    return tests


def test_the_page_has_the_table(update_goldens: bool) -> None:
    before, _, rest = PAGE.read_text().partition(BEGIN)
    old, _, after = rest.partition(END)
    if update_goldens:
        PAGE.write_text(f"{before}{BEGIN}{table()}{END}{after}")
    else:
        assert old == table(), "pytest tests/gitlab/test_rules.py --update-goldens brings it up to date"


@pytest.mark.parametrize("source", ["schedule", "trigger", "pipeline", "api", "web"])
def test_an_open_merge_request_hides_only_pushes(source: str) -> None:
    """On its branch all other pipelines test, as no pipeline of the merge request does for them."""
    for template in TEMPLATES:
        for rules in ("joined", "merge-requests", "branches"):
            variables = {**KINDS["push to a branch whose merge request is open"], "CI_PIPELINE_SOURCE": source}
            config = included(template, rules=rules)
            assert listed(config, variables) == jobs(config).keys() - {"dodo-deployment"}


@pytest.mark.parametrize("rules", ["joined", "merge-requests", "branches", "tags", "schedules"])
def test_a_deployment_is_triggered_where_one_is_named(rules: str) -> None:
    application = next(template for template in TEMPLATES if template.parent.name == "application")
    config = included(application, deployment="group/deployment", rules=rules)
    found = {kind for kind, variables in KINDS.items() if "dodo-deployment" in listed(config, variables)}
    default = {kind for kind, variables in KINDS.items() if variables.get("CI_COMMIT_BRANCH") == "main"}
    assert found == {"tags": {"tag"}, "schedules": {"schedule"}}.get(rules, default)
    for variables in KINDS.values():
        assert "dodo-deployment" not in listed(included(application, rules=rules), variables)
        without = included(application, deployment="group/deployment", rules=rules, images=False)
        assert not {"dodo-deployment", "dodo-images"} & listed(without, variables)


def test_rules_of_the_team_s_own_are_those_of_all_jobs() -> None:
    for template in TEMPLATES[:2]:
        own: Config = {".dodo-rules": {"rules": [{"if": "$NIGHT"}]}}
        config = merged(included(template, rules="merge-requests"), own)
        assert listed(config, KINDS["merge request"]) == set()
        assert "dodo-tests" in listed(config, {**KINDS["merge request"], "NIGHT": "1"})


@functools.cache
def foreign(name: str) -> tuple[Config, Config]:
    """A file of a team's without what it includes, and the inputs with which it includes a template."""
    text = FOREIGN[name].read_text()
    inputs = yaml.safe_load(text.splitlines()[0].removeprefix("# inputs: "))
    config = {key: value for key, value in yaml.safe_load(text).items() if key != "include"}
    return config, {key.replace("-", "_"): value for key, value in inputs.items()}


@pytest.mark.parametrize("name", FOREIGN)
def test_a_part_of_the_jobs_is_in_no_pipeline_of_a_team(name: str) -> None:
    """Else it would test nothing, and be green."""
    config, inputs = foreign(name)
    chosen = inputs.get("rules", "joined")
    for template in TEMPLATES:
        mine = jobs(included(template)).keys() - {"dodo-deployment"}
        around = {key: value for key, value in config.items() if key == "workflow"}
        for variables in KINDS.values():
            there = listed(merged(included(template, rules=chosen), around), variables)
            assert not there & mine or mine <= there


@pytest.mark.thorough
def test_gitlab_accepts_them(tmp_path: Path, accepted: Callable[..., None]) -> None:
    for name in FOREIGN:
        for template in TEMPLATES:
            config = merged(included(template, **foreign(name)[1]), foreign(name)[0])
            whole = {key: value for key, value in config.items() if key in ("workflow", "stages", "default")}
            text = yaml.safe_dump({**whole, **jobs(config)})
            (tmp_path / f"{name}.{template.parent.name}.yml").write_text(text)
    accepted(*tmp_path.iterdir())


def test_each_template_has_the_choice() -> None:
    options = [specified(template)["rules"]["options"] for template in TEMPLATES]
    assert {rules for rules, _ in COLUMNS.values()} == set(options[0]) and options.count(options[0]) == len(TEMPLATES)
