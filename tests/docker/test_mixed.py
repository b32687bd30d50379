"""The application in containers of a real engine, DoDo's services beside it as processes of this machine."""

import json
import os
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from tests.docker.compose import ODD, Crate, changed
from tests.run.desk import ROOT
from tests.run.faults import MARKS
from tests.run.helpers import AFTER_START, PASS, READY, WAIT

TEST = "sil-closed-straight"

pytestmark = [*MARKS["mixed"], pytest.mark.usefixtures("images")]


TAKES = """
import os, time
def take(folder):
    for name in [name for name in os.listdir(folder) if os.path.isdir(f"{folder}/{name}")]:
        for remove in (os.rmdir, lambda path: os.rename(path, path + "-gone")):
            try:
                remove(f"{folder}/{name}")
                os.symlink("/etc", f"{folder}/{name}")
                print("replaced", name, flush=True)
            except OSError as error:
                print(error.strerror, name, flush=True)
"""
OWN = "take('/tmp')\nopen('/tmp/app.log', 'w').close()\nprint('own file', flush=True)\n"


def test_root_in_a_container_takes_no_place_of_folders_of_services(crate: Crate) -> None:
    """They are mounted in the ``/tmp`` that the application shares with them, and reaches from a service without it."""
    judge = READY + AFTER_START + f"time.sleep(8)\nos.stat({str(crate.bench.folder)!r})\n" + PASS
    job = crate.job("takes", judge, TAKES + OWN + WAIT, user="0:0")
    application = job.plan.application
    (app,) = application.services
    app = replace(app, environment={"LOG": "/tmp/app.log"})
    services = (app, replace(app, name="other", after={"app": "service_started"}))
    container = application.compose["services"]["app"]
    entrypoint = ["python3", "-u", "-c", TAKES + "take('/proc/1/root/tmp')\ntime.sleep(600)"]
    other = {**container, "pid": "service:app", "entrypoint": entrypoint, "volumes": []}
    compose = {"services": {"app": container, "other": other}}
    plan = replace(job.plan, application=replace(application, services=services, compose=compose))
    job = changed(job, plan)
    (outcome,) = crate.run(job, backend="mixed").values()
    assert outcome.outcome == "passed", outcome.reason
    names = {path.parts[2] for path in (crate.bench.folder, job.folder)}
    for service in ("app", "other"):
        lines = crate.log("takes", service).splitlines()
        assert names and all(lines.count(f"Device or resource busy {name}") == 2 for name in names), (service, lines)
        assert not [line for line in lines if line.startswith("replaced")]
    assert "own file" in crate.log("takes")


def test_default_without_images_of_dodo(tmp_path: Path) -> None:
    """A drive in lockstep in a deployment whose images are nowhere, and whose application is only an image.

    It writes into a copy of its folder, whose name is odd.
    """
    tmp_path /= ODD
    tmp_path.mkdir()
    for name in (TEST, "maps"):
        shutil.copytree(ROOT / "tests_registry" / name, tmp_path / "tests" / name)
    shutil.copytree(ROOT / "examples" / "kiwi", tmp_path / "kiwi")
    compose = tmp_path / "kiwi" / "docker-compose.yml"
    lines = compose.read_text().replace("- /tmp:/tmp", "- /tmp:/tmp\n      - .:/own").splitlines()
    compose.write_text("\n".join(line for line in lines if "x-dodo-process" not in line))
    (tmp_path / "dodo.yml").write_text(
        "dodo: 1\nregistry: [tests]\napplication: kiwi/docker-compose.yml\nimages: {prefix: 127.0.0.1:9/none}\n"
    )
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "DODO_LEASES": str(tmp_path / "leases")}
    subprocess.run([sys.executable, "-m", "dodo_dsl", "run", TEST], cwd=tmp_path, env=environment, check=True)
    report = tmp_path / "dodo-report"
    (test,) = json.loads((report / "results.json").read_text())["tests"]
    assert (test["backend"], test["outcome"], test["clock"]) == ("mixed", "passed", "lockstep")
    assert "frame 1:" in (report / TEST / "logs" / "application.perception.log").read_text()
    assert (report / TEST / "test.rec").stat().st_size > 10_000
