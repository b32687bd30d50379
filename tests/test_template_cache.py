"""Compiled templates are kept between runs, and no run depends on that."""

from pathlib import Path

import jinja2
import pytest

from dodo_dsl.template_cache import compiled_templates


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    return tmp_path / "home"


def rendered(text: str = "{{ 6 * 7 }} words") -> str:
    environment = jinja2.Environment(loader=jinja2.DictLoader({"a": text}), bytecode_cache=compiled_templates())
    return environment.get_template("a").render()


def kept(home: Path) -> list[Path]:
    return [path for path in (home / ".cache").rglob("*") if path.is_file()]


def test_a_template_is_compiled_once(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert rendered() == "42 words"
    assert len(kept(home)) == 1
    monkeypatch.setattr(jinja2.Environment, "_generate", None)  # which compiling calls
    assert rendered() == "42 words"
    with pytest.raises(TypeError):
        rendered("changed")


def test_nothing_is_run_that_others_may_have_written(home: Path) -> None:
    rendered()
    (path,) = kept(home)
    path.parent.chmod(0o777)
    assert compiled_templates() is None
    assert rendered() == "42 words"
