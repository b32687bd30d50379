"""The output of a command replaces regular files only, whoever made what is in its place."""

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.hostile.command import dodo
from tests.rec.conftest import BEGIN, dodo_rec, video

ROOT = Path(__file__).parents[2]


WRITTEN = {"cut": "new.rec", "--csv": "opendlv.proxy.ImageReading-0.csv", "--frames": f"0-{BEGIN}.png"}
"""The files that commands write, by their last word."""


@pytest.mark.parametrize("kind", ["fifo", "socket", "device", "link", "folder"])
@pytest.mark.parametrize("words", [("cut",), ("export", "--csv"), ("export", "--frames")], ids=" ".join)
def test_a_command_replaces_nothing_but_files(
    record: Callable[..., Path], strange: dict[str, Path], kind: str, words: tuple[str, ...], tmp_path: Path
) -> None:
    target, output = tmp_path / "new" / WRITTEN[words[-1]], tmp_path / "new"
    output.mkdir()
    strange[kind].rename(target)
    before = target.lstat().st_ino
    code, _, stderr = dodo_rec(*words, record(video(1)), "-o", target if words == ("cut",) else output, "--force")
    assert (code, "cannot take the result" in stderr, target.lstat().st_ino) == (2, True, before), stderr
    assert [path.name for path in output.iterdir()] == [target.name]


@pytest.mark.thorough
@pytest.mark.parametrize(("link", "said"), [("", "a symlink, which no output follows"), ("files", "no compiled test")])
def test_compiling_follows_no_symlink(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, link: str, said: str) -> None:
    """Compiling follows no symlink that a repository has in the place of output."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "dodo.yml").write_text(f"dodo: 1\napplication: {ROOT}/examples/kiwi/docker-compose.yml\n")
    (tmp_path / "theirs").mkdir()
    (tmp_path / "theirs" / "precious").write_text("untouched")
    place = tmp_path / "generated" / "sil-closed-straight" / link
    place.parent.mkdir(parents=True)
    place.symlink_to(tmp_path / "theirs")
    code, output = dodo("compile", "sil-closed-straight")
    assert (code, said in output, place.is_symlink()) == (2, True, True), output
    if link:
        (tmp_path / "generated/sil-closed-straight/test.json").write_text('{"dodo": "plan"}')
        assert dodo("compile", "sil-closed-straight")[0] == 0
        assert place.is_dir() and not place.is_symlink(), "the whole folder is another one"
    assert [path.name for path in (tmp_path / "theirs").iterdir()] == ["precious"]


@pytest.mark.parametrize("parameter", ["rec", "snapshot"])
@pytest.mark.parametrize(
    "name",
    ["/root/.ssh/authorized_keys", "../a.rec", "/etc/cron.d/a", "/tmp/../etc/a", "a/b", ".bashrc", "", "/dev/null"],
)
def test_a_spec_names_no_output_elsewhere(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, parameter: str, name: str
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "dodo.yml").write_text("dodo: 1\nregistry: [.]\n")
    values = {"rec": "a.rec", "memories": ["a"], parameter: name}
    use = {"uses": "rec-recorder", "with": values}
    (tmp_path / "a.dodo.yml").write_text(f"dodo: 1\nname: a\nenvironment: {json.dumps({'more': use})}\n")
    _, output = dodo("compile", "--check")
    assert f"error[path-escape]: parameter '{parameter}' is '{name}', expected a file's name without" in output, output
