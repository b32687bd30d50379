"""Wheels for another Python than this one, once downloaded and then kept."""

from pathlib import Path

import pytest

from dodo_dsl.images import build_context
from dodo_dsl.images.build_context import Python

ARM = Python(11, "aarch64", 36)


def test_platforms_go_from_the_base_images_glibc_down_to_manylinux2014() -> None:
    platforms = Python(12, "x86_64", 19).platforms()
    assert platforms == [
        "manylinux_2_19_x86_64",
        "manylinux_2_18_x86_64",
        "manylinux_2_17_x86_64",
        "manylinux2014_x86_64",
    ]


@pytest.mark.slow
@pytest.mark.proof
def test_every_requirement_has_a_wheel_for_64_bit_arm(tmp_path: Path) -> None:
    folder = build_context.provide_wheels(ARM, tmp_path)
    names = [path.name for path in folder.iterdir()]
    assert len(names) >= 7
    assert all(name.endswith("aarch64.whl") or name.endswith("-any.whl") for name in names)
    assert build_context.provide_wheels(ARM, tmp_path) == folder
    assert [path.name for path in tmp_path.iterdir()] == [folder.name]  # nothing half done is left


@pytest.mark.thorough
def test_what_pip_cannot_download_is_one_sentence_and_leaves_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PIP_NO_INDEX", "1")
    monkeypatch.delenv("PIP_FIND_LINKS", raising=False)
    with pytest.raises(
        build_context.WheelsError, match=r"cannot download wheels for Python 3\.11 on aarch64: ERROR: \S"
    ):
        build_context.provide_wheels(ARM, tmp_path)
    assert list(tmp_path.iterdir()) == []
