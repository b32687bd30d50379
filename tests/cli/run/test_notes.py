"""What ``dodo run`` says before it runs anything; without an application it does not."""

import signal
from collections.abc import Iterator
from io import StringIO
from pathlib import Path

import pytest

from dodo_dsl.cli.main import main
from dodo_dsl.compiler import load

ROOT = Path(__file__).parents[3]
HIL = sum(spec.level == "hil" for spec in load([ROOT / "tests_registry"]).specs)


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A working folder; the process has its signal handlers again afterwards, which a run replaces."""
    monkeypatch.chdir(tmp_path)
    before = {number: signal.getsignal(number) for number in (signal.SIGTERM, signal.SIGHUP)}
    yield tmp_path
    for number, handler in before.items():
        signal.signal(number, handler)


def dodo(*words: str) -> tuple[int, str, str]:
    stdout, stderr = StringIO(), StringIO()
    return main(words, stdout, stderr), stdout.getvalue(), stderr.getvalue()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (
            ["hil-dynamic", "--clock", "lockstep"],
            "note: hil-dynamic runs in real time, because hardware does not wait\n",
        ),
        (
            ["hil-*", "--clock", "lockstep"],
            f"note: hil-camera and {HIL - 1} more run in real time, because hardware does not wait\n",
        ),
        (["hil-dynamic"], ""),
    ],
)
@pytest.mark.thorough
def test_hardware_keeps_its_clock_and_it_is_said(folder: Path, words: list[str], said: str) -> None:
    (folder / "dodo.yml").write_text('dodo: 1\nregistry: ["dodo:"]\n')
    code, out, err = dodo("run", *words)
    assert (code, out) == (2, said)
    assert err.startswith("dodo run: no application; ")


@pytest.mark.thorough
def test_who_cannot_be_a_process_is_told_what_to_write() -> None:
    assert dodo("new", "--deployment")[0] == dodo("new", "mine")[0] == 0
    code, _, err = dodo("run", "mine", "--backend", "process")
    assert (code, err) == (
        2,
        "dodo run: application service 'application' has no 'x-dodo-process', which the process backend needs; "
        "add for example 'x-dodo-process: [python, main.py]', or run with --backend mixed or docker\n",
    )
