"""A release: one version in all files, and a changelog that has it."""

import importlib.machinery
import importlib.util
from pathlib import Path
from types import ModuleType

import pytest

from dodo_dsl import __version__

SCRIPTS = Path(__file__).parents[2] / "scripts"


def script(name: str) -> ModuleType:
    """A script without an ending as a module."""
    loader = importlib.machinery.SourceFileLoader(name.replace("-", "_"), str(SCRIPTS / name))
    spec = importlib.util.spec_from_loader(loader.name, loader)
    assert spec
    module = importlib.util.module_from_spec(spec)
    loader.exec_module(module)
    return module


release = script("release")


def test_all_files_have_the_version(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert release.version() == __version__
    for path, text in release.COPIES.items():
        assert text.format(__version__) in (release.ROOT / path).read_text(), path
        (tmp_path / path).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / path).write_text(text.format(__version__))
    (tmp_path / release.SOURCE).parent.mkdir()
    (tmp_path / release.SOURCE).write_text(f'__version__ = "{__version__}"\n')
    (tmp_path / "CHANGELOG.md").write_text("# Changelog\n\n## [Unreleased]\n\n### Added\n\n- New.\n")
    monkeypatch.setattr(release, "ROOT", tmp_path)
    monkeypatch.setattr(release, "git", lambda *_: "")
    release.set_version("7.8.9")
    assert release.version() == "7.8.9" and not list(release.problems("7.8.9"))
    assert [problem.partition(":")[0] for problem in release.problems("7.9.0")][:-1] == list(map(str, release.COPIES))


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ("## [Unreleased]\n\n## [1.2.3] - 2026-01-02\n\n- New.\n", ()),
        ("## [Unreleased]\n\n- Newer.\n\n## [1.2.3] - 2026-01-02\n\n- New.\n", ("expected an empty section",)),
        ("## [Unreleased]\n\n## [1.2.3]\n\n- New.\n", ("expected a section",)),
        ("## [Unreleased]\n\n## [1.2.3] - 2026-01-02\n\n## [1.2.2] - 2026-01-01\n\n- Old.\n", ("expected a section",)),
    ],
)
def test_the_changelog_has_the_version_and_nothing_unreleased(changes: str, words: tuple[str, ...]) -> None:
    problems = list(release.changelog_problems(f"# Changelog\n\n{changes}", "1.2.3"))
    assert len(problems) == len(words) and all(word in problem for word, problem in zip(words, problems, strict=True))


def test_banned_wordings_are_named_with_better_ones(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    words = script("count-words")
    (tmp_path / "page.md").write_text("It tells why.\n\n```\nIt tells why.\n```\n\nIt was mended.\n")
    (tmp_path / "code.py").write_text('told = 1\nline = "this is no number"\n# at the begin\n')
    monkeypatch.setattr(words, "ROOT", tmp_path)
    banned = tuple(each for each in words.WORDINGS if each.banned)
    found = [(each.name, path, number) for each, path, number, _ in words.found(banned, ["page.md", "code.py"])]
    assert found == [
        ("tells, told", "page.md", 1),
        ("mend", "page.md", 7),
        ("is no X", "code.py", 2),
        ("begin (noun)", "code.py", 3),
    ]
