"""What is wrong with text that is not YAML, in the words of its author: the commonest slips of the pen."""

from collections.abc import Callable, Iterator

from dodo_dsl.slips import blocks, brackets, characters, lists, quotes, signs, texts
from dodo_dsl.slips.failure import Failure, Slip

_DETECTORS: tuple[Callable[[Failure], Iterator[Slip]], ...] = (
    characters.conflict,
    characters.tab,
    characters.foreign_blank,
    quotes.unclosed,
    quotes.text_behind,
    quotes.escape,
    lists.no_blank_after_dash,
    lists.other_dash,
    signs.other_colon,
    texts.bare_alias,
    texts.not_indented,
    blocks.no_blank_after_colon,
    texts.colon_in_text,
    blocks.no_colon,
    texts.colon_further_down,
    blocks.too_deep,
    lists.item_too_shallow,
    lists.dash,
    lists.list_with_key,
    lists.list_behind_key,
    characters.comment,
    brackets.one_too_many,
    blocks.between_levels,
    brackets.unclosed,
    brackets.wrong_kind,
    brackets.no_comma,
    brackets.no_value,
    signs.first_character,
    characters.block_text,
    characters.behind_the_end,
    blocks.unexpected,
)


def slip(failure: Failure) -> Slip | None:
    """The first explanation that fits what the parser stumbled over; None when there is none."""
    return next((found for detector in _DETECTORS for found in detector(failure)), None)
