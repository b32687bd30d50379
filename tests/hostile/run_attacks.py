"""Runs the attacks as the application of a test on processes, in a folder: as whoever calls it.

    python -m tests.hostile.run_attacks FOLDER < places.json

Prints the outcome and what became of each attack as JSON.
"""

import json
import os
import shutil
import sys
from dataclasses import replace
from pathlib import Path

from tests.hostile import attacks
from tests.run.helpers import PASS, READY, Bench

HIDDEN = ("tests", "drive.rec", "a.dodo.yml", "map.json")
JUDGE = READY + "while not os.path.exists('/tmp/attacks-done'): time.sleep(0.05)\n" + PASS


def main(argv: list[str]) -> int:
    folder = Path(argv[0])
    places = json.load(sys.stdin)
    bench = Bench(folder, "network")
    plan = bench.plan(judge=JUDGE, timeout_s=60.0)
    own = folder / "application"
    own.mkdir()
    (own / "tests").mkdir()
    (own / "tests" / "truth.json").write_text("[]")
    (own / ".git").mkdir()
    (own / ".git" / "packed").write_text("truths of all versions")
    (own / "data.txt").write_text("as it was")
    for name, text in {"drive.rec": "dodo", "a.dodo.yml": "dodo: 1", "map.json": '{"model": []}'}.items():
        (own / "tests" / name).write_text(text)
        (own / name).write_text(text)
    (own / "dodo-report").mkdir()
    (own / "dodo-report" / "results.json").write_text('{"dodo": "results"}')
    program = Path(shutil.copy(attacks.__file__, own / "attacks.py"))
    (app,) = plan.application.services
    places |= {"tests-in-its-folder": str(own / "tests" / "truth.json"), "results": str(folder / "report")}
    places["history-of-its-folder"] = str(own / ".git" / "packed")
    guessed = {"ATTACKED": json.dumps(places), "GUESSED": places["folder"]}
    service = replace(app, process=("python", str(program), places["folder"]), environment=guessed)
    application = replace(plan.application, folder="../application", services=(service,), hidden=HIDDEN)
    os.environ |= {"CI_JOB_TOKEN": "secret", "MY_SECRET": "secret", "OF_RUNNER": places["folder"]}
    (outcome,) = bench.run(replace(plan, application=application))
    lines = [json.loads(line) for line in bench.log(plan, "application.app").splitlines() if line.startswith("{")]
    kept = (own / "data.txt").read_text(), (own / "tests" / "truth.json").read_text()
    told = {"outcome": outcome.outcome, "reason": outcome.reason, "attacks": lines, "kept": kept}
    print(json.dumps(told))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
