"""The page on a service of one's own is what happens, down to the image that it describes."""

import sys
from pathlib import Path

import pytest
import yaml

from dodo_dsl import __version__
from dodo_dsl.images.names import base_of
from dodo_dsl.report.join import read_document
from dodo_dsl.report.viewer.encoded import unpacked
from tests.contributing.tutorial import New, follow, steps

PAGE = Path(__file__).parents[2] / "docs/how-to/services.md"


def file(name: str) -> str:
    """What the page writes into a file."""
    (text,) = [step.text for step in steps(PAGE.read_text()) if isinstance(step, New) and step.file == name]
    return text


@pytest.mark.slow
def test_it_can_be_followed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("PYTHONPATH", raising=False)
    monkeypatch.setenv("DODO_LEASES", str(tmp_path / "leases"))
    (tmp_path / "repository").mkdir()
    follow(PAGE, tmp_path / "repository", Path(sys.executable).parent)
    data = read_document(tmp_path / "repository" / "dodo-report" / "sil-smooth" / "drive.js")
    steps_over_time = next(each for each in data["judged"] if each["evaluator"] == "smooth")
    assert (steps_over_time["name"], steps_over_time["note"]) == ("Step of the steering", "at most 3 deg")
    assert unpacked(steps_over_time["values"]).max() > 3 and steps_over_time["marks"]
    (check,) = [each for each in data["checks"] if each["name"] == "largest-step"]
    assert "max-step: 3 deg" in check["places"][0]["text"]


def test_its_image_starts_what_the_manifest_says_on_this_version(tmp_path: Path) -> None:
    manifest = yaml.safe_load(file("my_services/smoothness/service.yml"))
    text = file("my_services/smoothness/Dockerfile")
    assert text.startswith(f"ARG DODO_BASE=dodo/base:{__version__}\n")
    assert f'ENTRYPOINT ["python3", "-m", "{manifest["process"][-1]}"]' in text
    (tmp_path / "Dockerfile").write_text(text)
    assert base_of(tmp_path / "Dockerfile") == "base"
