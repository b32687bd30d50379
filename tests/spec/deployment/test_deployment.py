"""The deployment file."""

import ipaddress
from pathlib import Path

from dodo_dsl import package_data
from dodo_dsl.spec.deployment import Deployment, find_deployment, load_deployment


def loaded(folder: Path, text: str) -> tuple[Deployment, list[tuple[str, str]]]:
    (folder / "dodo.yml").write_text(f"dodo: 1\n{text}")
    deployment, problems = load_deployment(folder / "dodo.yml")
    return deployment, [(problem.rule, problem.message) for problem in problems]


def test_the_nearest_file(tmp_path: Path) -> None:
    (tmp_path / "a/b").mkdir(parents=True)
    (tmp_path / "dodo.yml").touch()
    assert find_deployment(tmp_path / "a/b") == tmp_path / "dodo.yml"
    (tmp_path / "a/dodo.yml").touch()
    assert find_deployment(tmp_path / "a/b") == tmp_path / "a/dodo.yml"


def test_outside_of_all_deployments_that_of_the_named_paths_counts(tmp_path: Path) -> None:
    outside, one, other = (tmp_path / name for name in ("outside", "one", "other"))
    for folder in (outside, one / "tests", other / "tests"):
        folder.mkdir(parents=True)
    for folder in (one, other):
        (folder / "dodo.yml").write_text("dodo: 1\n")
    assert find_deployment(outside, [one / "tests", one / "tests" / "a.dodo.yml"]) == one / "dodo.yml"
    assert find_deployment(outside, [one / "tests", other / "tests"]) is None
    assert find_deployment(other, [one / "tests"]) == other / "dodo.yml"


def test_everything(tmp_path: Path) -> None:
    (tmp_path / "tests").mkdir()
    (tmp_path / "compose.yml").touch()
    (tmp_path / "tests/judge").mkdir()
    (tmp_path / "tests/judge/service.yml").touch()
    (tmp_path / "my.odvd").write_text("message my.Own [id = 3000] { float x [id = 1]; }")
    deployment, problems = loaded(
        tmp_path,
        "registry: [tests, 'dodo:']\nservices: [tests]\nmessages: [my.odvd]\napplication: [compose.yml]\n"
        "images: {prefix: own, tag: '7'}\ncids: 110-130\nsubnets: 10.1.0.0/24\ngates: false\n"
        "environment: [DISPLAY, LICENSE_KEY]\npaths: [/etc/ros/, ~/maps]\noutside: true\n"
        "rigs: {kiwi: {kind: static, cid: 120}}\n",
    )
    assert problems == []
    assert deployment.registry == (tmp_path / "tests", package_data.registry())
    assert (deployment.services, deployment.messages) == ((tmp_path / "tests",), (tmp_path / "my.odvd",))
    assert deployment.application == (tmp_path / "compose.yml",)
    assert (deployment.image_prefix, deployment.image_tag, deployment.gates) == ("own", "7", False)
    assert (deployment.environment, deployment.outside) == (("DISPLAY", "LICENSE_KEY"), True)
    assert deployment.paths == ("/etc/ros", str(Path("~/maps").expanduser()))
    assert set(deployment.cids) == set(range(110, 131)) - {111, 112, 120}
    assert deployment.subnets == ipaddress.IPv4Network("10.1.0.0/24")
    assert deployment.rig("kiwi") is deployment.rigs["kiwi"]
    emulated = deployment.rig("emulated")
    assert emulated is not None
    assert emulated.is_emulated
    assert deployment.rig("other") is None
