"""``dodo tune`` with drives whose margin follows from the application's variables."""

import json
import os
import shutil
import signal
from collections.abc import Iterator
from dataclasses import dataclass, field
from io import StringIO
from pathlib import Path
from typing import Any

import pytest

from dodo_dsl.cli.main import main
from dodo_dsl.outcome import with_margin
from dodo_dsl.plan.model import Plan
from dodo_dsl.run.protocol import Exited, Ready, VerdictEvent
from tests.check import examples
from tests.run.scripted import Events, ScriptedBackend
from tests.search.scripted_drives import scripted_commands

SPEC = """\
vary:
  start: {from: -8 cm, to: 8 cm, nominal: 0 cm}
environment: {camera: {uses: virtual-camera, with: {map-path: ../maps/plain}}}
action: {vehicle: {uses: dynamic-model}, pose: {uses: integrator, with: {x: "${vary.start}"}}}
# docker-compose.yml
services:
  driver:
    image: driver
    command: --cid=111
    environment: {KP: "${KP:-0.3}"}
    x-dodo:
      in: []
      out: [opendlv.proxy.GroundSteeringRequest, opendlv.proxy.PedalPositionRequest]
      tune: {KP: {from: 0.2, to: 3, default: 0.3}, SPEED: {from: 0.1, to: 1, default: 0.5}}
    x-dodo-process: [python, driver.py]
"""
BEST = 1.7
CRASHES = 2.8


def kp_of(plan: Plan) -> float:
    (service,) = plan.application.services
    return float(service.environment["KP"] or "nan")


def stages(plan: Plan) -> dict[str, Events]:
    pose = next(service for service in plan.services if service.name == "pose")
    start = float(next((flag.value for flag in pose.flags if flag.name == "x"), 0.0))
    ready = {
        layer: [(0.0, Ready(service.name)) for service in plan.layer(layer)]
        for layer in ("environment", "action", "evaluation")
    }
    if kp_of(plan) > CRASHES:
        return {**ready, "begin": [(0.0, Exited("track", 1))]}
    distance = abs(kp_of(plan) - BEST) + 2 * abs(start)
    ok = distance <= 1.6
    check = with_margin({"name": "far", "value": distance, "limit": {"max": 1.6}, "unit": "m", "ok": ok})
    return {
        **ready,
        "begin": [
            (0.0, VerdictEvent("track", ok, "it drove", (check,))),
            (0.0, Exited("track", 0)),
        ],
    }


@dataclass
class Tune:
    """``dodo tune`` in a folder of its own; Ctrl-C comes when drive number ``ends_at`` begins."""

    ends_at: int | None = None
    driven: list[str] = field(default_factory=list)

    def backend(self, plan: Plan, attempt: int) -> ScriptedBackend:
        self.driven.append(plan.slug)
        if len(self.driven) == self.ends_at:
            os.kill(os.getpid(), signal.SIGINT)
        return ScriptedBackend(plan, stages(plan))

    def __call__(self, *words: str, report: str = "report") -> tuple[int, str]:
        self.driven.clear()
        stdout, stderr = StringIO(), StringIO()
        code = main(["tune", "--isolation", "host", "--report", report, *words], stdout, stderr)
        assert "Traceback" not in stdout.getvalue() + stderr.getvalue()
        return code, stdout.getvalue() + stderr.getvalue()


def result(report: str = "report") -> dict[str, Any]:
    return dict(json.loads(Path(report, "tune", "tune.json").read_text()))


@pytest.fixture
def tune(tmp_path: Path) -> Iterator[Tune]:
    made = Tune()
    with scripted_commands(tmp_path, SPEC, made.backend):
        yield made


@pytest.mark.thorough
def test_the_best_values_are_near_the_best_there_are(tune: Tune) -> None:
    code, out = tune("example", "--runs", "16")
    found = result()
    assert (code, found["default"]["values"]) == (0, {"KP": "0.3", "SPEED": "0.5"})
    assert abs(float(found["best"]["values"]["KP"]) - BEST) < 0.2
    assert found["best"]["margin"] > found["default"]["margin"] + 0.3
    bests = [one["best"] for one in found["progress"]]
    assert bests == sorted(bests) and bests[-1] == found["best"]["margin"]
    assert -1.0 in [one["margin"] for one in found["progress"]]
    lines = [f"{name}={text}" for name, text in found["best"]["values"].items()]
    assert Path("report/tune/best.env").read_text().splitlines() == lines
    assert "worst margin" in out and "values: report/tune/best.env" in out


@pytest.mark.parametrize(("more", "ends_at"), [(("--runs", "10"), 10), (("--runs", "2", "--samples", "1"), 5)])
@pytest.mark.thorough
def test_an_interrupted_tuning_goes_on_to_the_same_result(tune: Tune, more: tuple[str, ...], ends_at: int) -> None:
    words = ("example", "-j", "1", *more)
    tune(*words, report="whole")
    whole = len(tune.driven)
    tune.ends_at = ends_at
    code, out = tune(*words)
    assert (code, "the same command goes on" in out) == (130, True)
    first, tune.ends_at = len(tune.driven), None
    assert tune(*words)[0] == 0
    assert result() == result("whole")
    assert whole <= first + len(tune.driven) <= whole + 1
    assert (tune(*words)[0], tune.driven) == (0, [])


def test_an_application_elsewhere_is_tuned(tune: Tune, tmp_path_factory: pytest.TempPathFactory) -> None:
    elsewhere = tmp_path_factory.mktemp("elsewhere")
    shutil.copy("docker-compose.yml", elsewhere)
    (elsewhere / "driver.py").touch()
    code, out = tune("example", "--runs", "1", "--application", str(elsewhere / "docker-compose.yml"))
    assert (code, len(tune.driven)) == (0, 2), out


@pytest.mark.parametrize(
    ("old", "new", "words", "said"),
    [
        ("tune: {KP", "# {KP", ("example",), "no parameters to tune"),
        ("action:", "application: {env: {KP: 1}}\naction:", ("example",), "sets 'KP' itself"),
        ("from: 0.2, to: 3", "from: 4, to: 3", ("example",), "'from' is 4, expected less than 'to', 3"),
        ("", "", ("nothing",), "unknown test 'nothing'"),
        ("", "", ("base", "--samples", "2"), "'--samples' needs a test with ranges"),
        ("    x-dodo-process: [python, driver.py]\n", "", ("example",), "'x-dodo-process'"),
    ],
)
def test_what_cannot_be_tuned(tune: Tune, old: str, new: str, words: tuple[str, ...], said: str) -> None:
    examples.write(SPEC.replace(old, new), Path())
    code, out = tune(*words)
    assert (code, tune.driven) == (2, [])
    assert said in out
