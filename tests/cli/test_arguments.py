"""What is said of words that a command line does not know: the usage of the command meant, and a suggestion."""

import pytest

from dodo_dsl.cli.main import main

SAID = {
    "runn": ("usage: dodo [", "dodo: error: unknown command 'runn'; did you mean 'run'?"),
    "xyzzy": ("usage: dodo [", "dodo: error: unknown command 'xyzzy'; --help shows what there is"),
    "run --leevl sil": ("usage: dodo run ", "dodo run: error: unknown option '--leevl'; did you mean '--level'?"),
    "run --level sli": (
        "usage: dodo run ",
        "dodo run: error: --level: 'sli' is not one of sil, dil, hil; did you mean 'sil'?",
    ),
    "rec inf": ("usage: dodo rec ", "dodo rec: error: unknown action 'inf'; did you mean 'info'?"),
    "rec info x.rec --jsn": (
        "usage: dodo rec info ",
        "dodo rec info: error: unknown option '--jsn'; did you mean '--json'?",
    ),
    "lsp here": ("usage: dodo lsp ", "dodo lsp: error: 'here' is one word too many"),
}


@pytest.mark.parametrize("words", SAID)
def test_a_mistyped_word_is_named_by_its_own_command(words: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(words.split(), None, None) == 2  # type: ignore[arg-type]
    usage, sentence = SAID[words]
    said = capsys.readouterr().err
    assert said.startswith(usage)
    assert sentence in said.splitlines()[-1]
