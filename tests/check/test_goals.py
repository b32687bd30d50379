"""Goals in the units of their checks, and of evaluators whose manifests do not tell."""

from pathlib import Path

from dodo_dsl.check.goals import resolved_goals
from dodo_dsl.compiler import Sources, load
from dodo_dsl.spec.model import Goal
from tests.check import examples

OWN = """
# dodo.yml
services: [my_services]
# my_services/judge/service.yml
name: judge
layers: [evaluation]
image: judge
process: [python, -m, my_services.judge]
description: Judges the steering.
messages: {in: ["opendlv.proxy.GroundSteeringRequest"]}
"""


def resolved(folder: Path, example: str) -> tuple[tuple[Goal, ...], list[tuple[str, str]]]:
    examples.write(example, folder)
    (test,) = load([folder / "tests" / "example"], sources=Sources(folder)).tests
    found = resolved_goals(test)
    return found.goals, [(problem.rule, problem.message) for problem in found.problems]


def test_values_are_in_the_unit_of_the_check(tmp_path: Path) -> None:
    goals, problems = resolved(
        tmp_path,
        "goals:\n"
        "  time-to-goal: {better: less, zero: 1 min, one: 5 s, weight: 2}\n"
        "  wall-margin: {better: more, zero: 0 cm, one: 20 cm}\n"
        "  slow-answers: {better: less, zero: 10 %, one: 0}\n"
        "  peak-memory-steering: {better: less, zero: 1 GB, one: 100 MB}\n",
    )
    assert problems == []
    assert goals == (
        Goal("time-to-goal", 60.0, 5.0, 2.0), Goal("wall-margin", 0.0, 0.2), Goal("slow-answers", 0.1, 0.0),
        Goal("peak-memory-steering", 1000.0, 100.0),
    )  # fmt: skip


def test_an_evaluator_that_does_not_tell_takes_bare_numbers(tmp_path: Path) -> None:
    text = (
        "goals:\n"
        "  smooth: {better: more, zero: 0, one: 10}\n"
        "  quick: {better: less, zero: 3 s, one: 1}\n"
        "evaluation: {own: {uses: judge}}\n"
    )
    goals, problems = resolved(tmp_path, text + OWN)
    assert goals == (Goal("smooth", 0.0, 10.0),)
    told = "'zero': '3 s' is not a number, and its evaluator's manifest does not declare the check's unit"
    assert problems == [("wrong-unit", told)]


def test_checks_of_classes_are_known_by_pattern(tmp_path: Path) -> None:
    text = (
        "kind: perception\n"
        "goals: {recall-yellow: {better: more, zero: 50 %, one: 1}}\n"
        "evaluation: {cones: {uses: object-detection, with: {truth: cones.json, min-recall: 80 %}}}\n"
        "# tests/example/cones.json\n"
        '{"images": [], "categories": [], "annotations": []}\n'
    )
    assert resolved(tmp_path, text) == ((Goal("recall-yellow", 0.5, 1.0),), [])
