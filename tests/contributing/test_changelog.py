"""The changelog keeps to Keep a Changelog: versions from new to old, known sections in order, no empty one."""

import re
from pathlib import Path

TEXT = (Path(__file__).parents[2] / "CHANGELOG.md").read_text()
SECTIONS = ["Added", "Changed", "Deprecated", "Removed", "Fixed", "Security"]
_VERSION = re.compile(r"\[Unreleased\]|\[\d+\.\d+\.\d+\] - \d{4}-\d\d-\d\d")


def test_versions_and_sections() -> None:
    versions = TEXT.split("\n## ")[1:]
    titles = [version.partition("\n")[0] for version in versions]
    assert titles[0] == "[Unreleased]" and all(_VERSION.fullmatch(title) for title in titles)
    assert titles[1:] == sorted(titles[1:], key=lambda title: [int(n) for n in re.findall(r"\d+", title)], reverse=True)
    for version in versions:
        sections = [part.partition("\n") for part in version.split("\n### ")[1:]]
        names = [name for name, _, _ in sections]
        assert names == [name for name in SECTIONS if name in names]
        assert all(text.strip().count("\n- ") or text.strip().startswith("- ") for _, _, text in sections)
