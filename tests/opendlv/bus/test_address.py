import subprocess
import sys

LOADED = "import sys; import dodo_dsl.opendlv.address; print(*(m for m in sys.modules if m.startswith('dodo_dsl')))"


def test_sandboxes_load_it_without_anything_else() -> None:
    loaded = subprocess.run([sys.executable, "-S", "-c", LOADED], capture_output=True, text=True, check=True).stdout
    assert set(loaded.split()) == {
        "dodo_dsl", "dodo_dsl.opendlv", "dodo_dsl.opendlv.address",
    }  # fmt: skip
