"""An application that mounts the folder of a compiled test finds it empty."""

import pytest

from tests.docker.compose import Crate
from tests.run.helpers import DRIVES, WAIT

pytestmark = [pytest.mark.engine, pytest.mark.usefixtures("images")]

LOOK = """
import os
folder = f"/scripts/compiled/{os.path.basename(sys.argv[0]).rpartition('-')[0]}"
print(sorted(os.listdir(folder)), flush=True)
try:
    open(f"{folder}/left-behind", "w")
except OSError as error:
    print(error.strerror, flush=True)
print(sorted(os.listdir("/scripts/earlier")), flush=True)
"""


def test_the_test_is_hidden(crate: Crate) -> None:
    """And so is an earlier report, whatever its folder is called."""
    earlier = crate.bench.folder / "earlier"
    earlier.mkdir()
    (earlier.parent / "dodo.yml").touch()  # the root of its repository
    (earlier / "results.json").write_text('{"dodo": "results"}')
    job = crate.job("hidden", judge=DRIVES, application=LOOK + WAIT)
    (outcome,) = crate.run(job).values()
    assert outcome.outcome == "passed", outcome.reason
    assert crate.log("hidden") == "[]\nRead-only file system\n[]\n"
    assert (job.folder / "test.json").is_file()
    assert not (job.folder / "left-behind").exists()
