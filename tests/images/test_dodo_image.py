"""The image `dodo`, as a job of a pipeline has it: a new application and its test, in a container of nobody's."""

import re
import tomllib
from collections.abc import Iterator

import pytest

from dodo_dsl import __version__
from tests.images.conftest import PLUGINS, PROGRAMS, ROOT, WITH_PROGRAMS, build, docker, with_programs

pytestmark = pytest.mark.engine

TAG = "images"


@pytest.fixture(scope="module")
def dodo(built: dict[str, str], base_image: str) -> Iterator[str]:
    """The image on the layers of the others, as it stands on their last stage."""
    if with_programs(base_image) != WITH_PROGRAMS:
        pytest.skip(f"not all of {', '.join((*PROGRAMS, *PLUGINS))} are on this machine (scripts/install-test-tools)")
    words = ("dodo", "--prefix", "dodo-test", "--tag", TAG)
    yield build(WITH_PROGRAMS, *words)["dodo"]
    docker("image", "rm", "--force", f"dodo-test/dodo:{TAG}")


def test_it_has_what_jobs_call(dodo: str) -> None:
    commands = "dodo --version && docker compose version && docker buildx version && git --version && bwrap --version"
    said = docker("run", "--rm", "--network", "none", dodo, "sh", "-c", commands)
    assert said.splitlines()[0] == f"dodo {__version__}"
    assert [line.partition(" ")[0] for line in said.splitlines()[1:]] == ["Docker", "github.com/docker/buildx", "git",
                                                                          "bubblewrap"]  # fmt: skip
    assert docker("run", "--rm", "--network", "none", dodo).startswith("usage: dodo ")


def runner_flags() -> list[str]:
    """What docs/how-to/gitlab.md has a runner allow the container of a job."""
    page = (ROOT / "docs" / "how-to" / "gitlab.md").read_text()
    (block,) = [text for text in re.findall(r"```toml\n(.*?)```", page, re.DOTALL) if "cap_add" in text]
    settings = tomllib.loads(block)["runners"][0]["docker"]
    capabilities = [f"--cap-add={name}" for name in settings["cap_add"]]
    return capabilities + [f"--security-opt={option}" for option in settings["security_opt"] if "seccomp" in option]


@pytest.mark.parametrize("isolated", [True, pytest.param(False, marks=pytest.mark.proof)])
def test_a_new_application_passes_its_test(dodo: str, isolated: bool) -> None:
    """AppArmor is not on every machine. Multicast needs a network; a container's own one reaches nobody else."""
    flags, words = (runner_flags(), "") if isolated else ([], "--isolation host")
    script = f"mkdir /tmp/team && cd /tmp/team && dodo new --application && dodo run sil-first {words}"
    assert "PASSED  sil-first" in docker("run", "--rm", *flags, dodo, "sh", "-c", script)


def test_a_job_without_rights_is_told_what_to_do(dodo: str) -> None:
    script = "mkdir /tmp/team && cd /tmp/team && dodo new --application && dodo run sil-first; test $? = 3"
    assert "the application cannot be isolated on this machine" in docker("run", "--rm", dodo, "sh", "-c", script)
