"""What tests cannot have together."""

from pathlib import Path

from dodo_dsl.check.spec_rules import check_suite
from tests.check.contexts import checked


def test_what_tests_cannot_have_together(tmp_path: Path) -> None:
    """Also those with errors of their own; each is said once, and named by what is largest."""
    example = "isolation: host\nmatrix: {n: [1, 2, 3]}\ndescription: At ${matrix.n}.\ntimeout: 60 sx\n"
    services = ", ".join(f"{name}: {{image: x, command: --cid=111}}" for name in "abcdefgh")
    compose = f"# docker-compose.yml\nservices: {{{services}}}\n"
    found = checked(f"{example}# dodo.yml\ncids: 128-129\nsubnets: 10.213.0.0/28\n{compose}", tmp_path)
    together = check_suite(found.tests, found.deployment, found.application)
    assert [(problem.rule, Path(problem.span.file).name, problem.span.line) for problem in together] == [
        ("out-of-cids", "dodo.yml", 1),
        ("out-of-range", "dodo.yml", 1),
    ]
