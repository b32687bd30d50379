"""The image `dodo`, as a job of a pipeline has it: a new application and its test, in a container of nobody's."""

import re
import shutil
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

from dodo_dsl import __version__
from tests.images.conftest import build, docker
from tests.images.dockerfile import ROOT

pytestmark = pytest.mark.engine

TAG = "images"
PROGRAMS = {"docker": "usr/local/bin", "bwrap": "usr/bin", "git": "usr/bin"}
PLUGINS = ("docker-compose", "docker-buildx")
PLUGIN_PLACES = (Path.home() / ".docker" / "cli-plugins", Path("/usr/libexec/docker/cli-plugins"))


def place_of(plugin: str) -> Path:
    found = next((folder / plugin for folder in PLUGIN_PLACES if (folder / plugin).is_file()), None)
    if found is None:
        pytest.skip(f"{plugin} is not on this machine (scripts/install-compose)")
    return found


@pytest.fixture(scope="module")
def dodo(base_image: str, tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """The image, on a base with this machine's own programs, so that no build needs an index of packages."""
    folder = tmp_path_factory.mktemp("programs")
    copied = {Path(where, name): shutil.which(name) for name, where in PROGRAMS.items()}
    copied |= {Path("usr/local/libexec/docker/cli-plugins", name): str(place_of(name)) for name in PLUGINS}
    for target, source in copied.items():
        if source is None:
            pytest.skip(f"{target.name} is not on this machine")
        (folder / "root" / target).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(source, folder / "root" / target)
    (folder / "Dockerfile").write_text(f"FROM {base_image}\nCOPY root /\n")
    docker("build", "--quiet", "--tag", f"dodo-test-programs:{TAG}", str(folder))
    words = ("dodo", "--prefix", "dodo-test", "--tag", TAG, "--docker-image", f"dodo-test-programs:{TAG}")
    yield build(f"dodo-test-programs:{TAG}", *words)["dodo"]
    docker("image", "rm", "--force", f"dodo-test/dodo:{TAG}", f"dodo-test-programs:{TAG}")


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


@pytest.mark.parametrize("isolated", [True, False])
def test_a_new_application_passes_its_test(dodo: str, isolated: bool) -> None:
    """AppArmor is not on every machine. Multicast needs a network; a container's own one reaches nobody else."""
    flags, words = (runner_flags(), "") if isolated else ([], "--isolation host")
    script = f"mkdir /tmp/team && cd /tmp/team && dodo new --application && dodo run sil-first {words}"
    assert "PASSED  sil-first" in docker("run", "--rm", *flags, dodo, "sh", "-c", script)


def test_a_job_without_rights_is_told_what_to_do(dodo: str) -> None:
    script = "mkdir /tmp/team && cd /tmp/team && dodo new --application && dodo run sil-first; test $? = 3"
    assert "the application cannot be isolated on this machine" in docker("run", "--rm", dodo, "sh", "-c", script)
