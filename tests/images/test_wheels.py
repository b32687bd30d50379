"""Wheels for another Python than this one."""

from pathlib import Path

import pytest

from dodo_dsl.images import build_context
from dodo_dsl.images.docker_command import DockerError

ARM = 11, "aarch64"


@pytest.mark.slow
@pytest.mark.proof
def test_every_requirement_has_a_wheel_for_64_bit_arm(tmp_path: Path) -> None:
    build_context.download(ARM, tmp_path)
    names = [path.name for path in tmp_path.iterdir()]
    assert len(names) >= 7
    assert all(name.endswith("aarch64.whl") or name.endswith("-any.whl") for name in names)


@pytest.mark.thorough
def test_what_pip_cannot_download_is_one_sentence(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PIP_NO_INDEX", "1")
    monkeypatch.delenv("PIP_FIND_LINKS", raising=False)
    with pytest.raises(DockerError, match=r"cannot download wheels for Python 3\.11 on aarch64: ERROR: \S"):
        build_context.download(ARM, tmp_path)
