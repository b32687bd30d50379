"""The commonest slips of YAML: what each changes in the good test, and what is said about it.

The changes are texts for lines of ``good.dodo.yml``, None where a line goes. Names that begin with ``crlf`` have lines
as Windows ends them.
"""

from typing import NamedTuple


class Wrong(NamedTuple):
    """``said`` has line and column, rule and message."""

    changes: dict[int, str | None]
    said: str
    hint: str


SLIPS = {
    "alias-bare-first": Wrong(
        {
            9: "  camera: {uses: virtual-camera, with: {map-path: maps/plain, freq: &rate 10 Hz}}",
            13: "    with:\n      *rate",
        },
        "14:7 yaml-syntax: '*rate' stands among keys, expected a key before it",
        "write '<<: *rate'",
    ),
    "alias-bare": Wrong(
        {
            9: "  camera: {uses: virtual-camera, with: {map-path: maps/plain, freq: &rate 10 Hz}}",
            14: "      freq: 100 Hz\n      *rate",
        },
        "15:7 yaml-syntax: '*rate' stands among keys, expected a key before it",
        "write '<<: *rate'",
    ),
    "alias-misspelt": Wrong(
        {
            9: "  camera: {uses: virtual-camera, with: {map-path: maps/plain, freq: &rate 10 Hz}}",
            14: "      freq: *raet",
        },
        "14:13 yaml-syntax: alias '*raet' refers to an anchor that is missing or incomplete",
        "did you mean '*rate'?",
    ),
    "alias-star-behind": Wrong(
        {20: "      goal: *finish*"},
        "20:13 yaml-syntax: a text cannot begin with '*', which begins an alias",
        "write the text in quotes",
    ),
    "block-above-brace-open": Wrong(
        {
            3: "description: |\n  Drive along a straight track:\n  to the finish line, 'slowly [and",
            15: "  pose: {uses: integrator, with: {freq: 100 Hz}",
        },
        "17:9 yaml-syntax: '{' is not closed",
        "add '}' at the end of line 17",
    ),
    "block-above-brace-too-many": Wrong(
        {
            3: "description: >-\n  Drive along a straight track:\n  to the finish line, 'slowly [and",
            15: "  pose: {uses: integrator, with: {freq: 100 Hz}}}",
        },
        "17:49 yaml-syntax: '}' closes nothing",
        "remove it: there is one bracket too many",
    ),
    "block-above-colon": Wrong(
        {
            3: "description: >\n  Drive along a straight track:\n  to the finish line, 'slowly [and",
            22: "      max-time:40 s",
        },
        "24:15 yaml-syntax: a space is missing after the colon of 'max-time'",
        "write 'max-time: 40 s'",
    ),
    "block-above-indent": Wrong(
        {3: "description: >\n  Drive\n\n   key: value\n level: sil", 4: None},
        "7:2 yaml-syntax: indented by 1 space, but the lines above by 0",
        "keys of one mapping begin in the same column",
    ),
    "block-above-next-equals": Wrong(
        {3: "description: >\n  Drive along.\nlevel = sil", 4: None},
        "5:1 yaml-syntax: '=' stands after 'level', expected a colon",
        "write 'level: sil'",
    ),
    "block-above-next": Wrong(
        {3: "description: >\n  Drive along.\nlevel:sil", 4: None},
        "5:6 yaml-syntax: a space is missing after the colon of 'level'",
        "write 'level: sil'",
    ),
    "block-above-percent": Wrong(
        {3: "description: |+\n  Drive, and\n\n  key:value\n   [open\n", 22: "      max-time: %85"},
        "27:17 yaml-syntax: a text cannot begin with '%', which begins a directive",
        "write '85 %'",
    ),
    "block-above-placeholder": Wrong(
        {
            3: "description: |2\n    Drive:\n  more",
            9: "  camera: {uses: virtual-camera, with: {map-path: maps/plain, freq: ${matrix.light}}}",
        },
        "11:69 yaml-syntax: '${matrix.light}' within brackets needs quotes, as braces mean something else in YAML",
        'write "${matrix.light}"',
    ),
    "block-above-quote": Wrong(
        {
            3: "description: > # why\n  Drive along a straight track:\n  to the finish line, 'slowly [and",
            20: '      goal: "finish',
        },
        "22:13 yaml-syntax: this quotation mark is not closed in its line",
        'add " at the end of the text',
    ),
    "block-below-conflict": Wrong(
        {3: "description: |\n  =======\n  Drive", 21: "      walls:[left, right]"},
        "23:12 yaml-syntax: a space is missing after the colon of 'walls'",
        "write 'walls: [left, right]'",
    ),
    "bracket-brace-open": Wrong(
        {9: "  camera: {uses: virtual-camera, with: {map-path: maps/plain, freq: 10 Hz}"},
        "9:11 yaml-syntax: '{' is not closed",
        "add '}' at the end of line 9",
    ),
    "bracket-comma-missing-between": Wrong(
        {9: "  camera: {uses: virtual-camera, with: {map-path: maps/plain freq: 10 Hz}}"},
        "9:62 yaml-syntax: a comma is missing before 'freq'",
        "entries within brackets are separated by commas",
    ),
    "bracket-comma-missing": Wrong(
        {9: "  camera: {uses: virtual-camera with: {map-path: maps/plain, freq: 10 Hz}}"},
        "9:33 yaml-syntax: a comma is missing before 'with'",
        "entries within brackets are separated by commas",
    ),
    "bracket-flow-colon": Wrong(
        {15: "  pose: {uses: integrator, with: {freq 100 Hz}}"},
        "15:35 unknown-parameter: a colon is missing after 'freq'",
        "write 'freq: 100 Hz'",
    ),
    "bracket-long-open": Wrong(
        {9: "  camera: {uses: virtual-camera,\n           with: {map-path: maps/plain, freq: 10 Hz}"},
        "9:11 yaml-syntax: '{' is not closed",
        "add '}' at the end of line 10",
    ),
    "bracket-placeholder": Wrong(
        {9: "  camera: {uses: virtual-camera, with: {map-path: maps/plain, freq: ${matrix.freq}}}"},
        "9:69 yaml-syntax: '${matrix.freq}' within brackets needs quotes, as braces mean something else in YAML",
        'write "${matrix.freq}"',
    ),
    "bracket-square-open": Wrong(
        {21: "      walls: [left, right"}, "21:14 yaml-syntax: '[' is not closed", "add ']' at the end of line 21"
    ),
    "bracket-too-many": Wrong(
        {9: "  camera: {uses: virtual-camera, with: {map-path: maps/plain, freq: 10 Hz}}}"},
        "9:76 yaml-syntax: '}' closes nothing",
        "remove it: there is one bracket too many",
    ),
    "bracket-wrong-kind": Wrong(
        {21: "      walls: [left, right}"}, "21:26 yaml-syntax: '}' closes what '[' opened", "write ']'"
    ),
    "brackets-round": Wrong(
        {15: "  pose: (uses: integrator)"},
        "15:14 yaml-syntax: a second colon in the value of 'pose', which must be one string",
        "write braces: 'pose: {uses: integrator}'",
    ),
    "char-at": Wrong(
        {3: "description: @Drive along a straight track to the finish line."},
        "3:14 yaml-syntax: a text cannot begin with '@'",
        "write the text in quotes",
    ),
    "char-backtick": Wrong(
        {4: "level: `sil`"}, "4:8 yaml-syntax: a text cannot begin with '`'", "write the text in quotes"
    ),
    "char-byte-order-mark": Wrong(
        {4: "\ufefflevel: sil"},
        "4:1 yaml-syntax: this blank is not a space but a zero width no-break space (U+FEFF)",
        "remove it",
    ),
    "char-curly-quotes": Wrong(
        {4: "level: “sil”"},
        "4:8 wrong-value: '“sil”' is not a value of 'level', expected sil, dil, hil",
        "did you mean 'sil'?",
    ),
    "char-nbsp-in-value": Wrong(
        {6: "timeout: 60\u00a0s"},
        "6:10 wrong-unit: 'timeout': '60\u00a0s' is not a quantity in s",
        "write for example '1 s'",
    ),
    "char-nbsp-indent": Wrong(
        {18: "\u00a0\u00a0\u00a0 uses: collision"},
        "18:3 yaml-syntax: this blank is not a space but a no-break space (U+00A0)",
        "write a space",
    ),
    "char-nbsp": Wrong(
        {4: "level:\u00a0sil"},
        "4:7 yaml-syntax: this blank is not a space but a no-break space (U+00A0)",
        "write a space",
    ),
    "char-nul": Wrong(
        {4: "level: s\u0000il"}, "4:9 yaml-syntax: a control character is not allowed here: NUL (U+0000)", "remove it"
    ),
    "char-percent-share": Wrong(
        {6: "timeout: %60 # of them"},
        "6:10 yaml-syntax: a text cannot begin with '%', which begins a directive",
        "write '60 %'",
    ),
    "char-vertical-tab": Wrong(
        {3: "description: Über\u000b die Linie"},
        "3:18 yaml-syntax: a control character is not allowed here: vertical tab (U+000B)",
        "remove it",
    ),
    "char-zero-width": Wrong(
        {4: "level: s\u200bil"},
        "4:8 wrong-value: 's\u200bil' is not a value of 'level', expected sil, dil, hil",
        "did you mean 'sil'?",
    ),
    "colon-equals": Wrong(
        {4: "level = sil"},
        "4:1 yaml-syntax: '=' stands after 'level', expected a colon",
        "write 'level: sil', or indent the line if it goes on with the text above",
    ),
    "colon-full-width": Wrong(
        {4: "level：sil"},
        "4:6 yaml-syntax: '：', a fullwidth colon (U+FF1A), stands after 'level', expected a colon",
        "write 'level: sil'",
    ),
    "colon-further-down-word": Wrong(
        {3: "description: Drive along a straight track.\n  Note: slowly."},
        "4:7 yaml-syntax: a colon in the text of 'description', which goes on here",
        "put the text in quotes, or write '>' behind 'description:' and the text below",
    ),
    "colon-further-down": Wrong(
        {3: "description: Drive along a straight track\n  to the finish line. Note: slowly."},
        "4:27 yaml-syntax: a colon in the text of 'description', which goes on here",
        "put the text in quotes, or write '>' behind 'description:' and the text below",
    ),
    "colon-in-text": Wrong(
        {3: "description: Note: drive along a straight track to the finish line."},
        "3:18 yaml-syntax: a second colon in the value of 'description', which must be one string",
        "write the text in quotes",
    ),
    "colon-missing-section": Wrong(
        {10: "action"}, "10:1 yaml-syntax: a colon is missing after 'action'", "write 'action:'"
    ),
    "colon-missing": Wrong(
        {4: "level sil"},
        "4:1 yaml-syntax: a colon is missing after 'level'",
        "write 'level: sil', or indent the line if it goes on with the text above",
    ),
    "colon-no-blank-brace": Wrong(
        {13: "    with:{freq: 100 Hz}", 14: None},
        "13:5 unknown-key: a space is missing after the colon of 'with'",
        "write 'with: {...}'",
    ),
    "colon-no-blank-flow": Wrong(
        {15: "  pose: {uses:integrator, with: {freq: 100 Hz}}"},
        "15:10 unknown-key: a space is missing after the colon of 'uses'",
        "write 'uses: integrator'",
    ),
    "colon-no-blank-last": Wrong(
        {22: "      max-time:40 s"},
        "22:15 yaml-syntax: a space is missing after the colon of 'max-time'",
        "write 'max-time: 40 s'",
    ),
    "colon-no-blank-nested": Wrong(
        {18: "    uses:collision"},
        "18:9 yaml-syntax: a space is missing after the colon of 'uses'",
        "write 'uses: collision'",
    ),
    "colon-no-blank": Wrong(
        {4: "level:sil"}, "4:6 yaml-syntax: a space is missing after the colon of 'level'", "write 'level: sil'"
    ),
    "colon-semicolon": Wrong(
        {4: "level; sil"}, "4:6 yaml-syntax: ';' stands after 'level', expected a colon", "write 'level: sil'"
    ),
    "comment-no-blank": Wrong(
        {4: "level: sil#simulated"},
        "4:8 wrong-value: 'sil#simulated' is not a value of 'level', expected sil, dil, hil",
        "a comment begins with ' #', after a space",
    ),
    "comment-slashes": Wrong(
        {3: "description: Drive along a straight track to the finish line.\n// simulated"},
        "4:1 yaml-syntax: '//' does not begin a comment",
        "comments begin with '#'",
    ),
    "crlf-indent": Wrong(
        {21: "     walls: [left, right]"},
        "21:6 yaml-syntax: indented by 5 spaces, but the lines above by 4 or 6",
        "keys of one mapping begin in the same column",
    ),
    "crlf-quote": Wrong(
        {4: 'level: "sil'},
        "4:8 yaml-syntax: this quotation mark is not closed in its line",
        'add " at the end of the text',
    ),
    "crlf-tab": Wrong(
        {18: "\tuses: collision"}, "18:1 yaml-tab: this line is indented with a tab", "indent with spaces"
    ),
    "dash-for-key": Wrong(
        {4: "- level: sil"},
        "4:1 yaml-syntax: '- ' begins an item of a list, expected a key as in the lines above",
        "remove the '- '",
    ),
    "document-second": Wrong(
        {7: "clock: lockstep\n---"},
        "8:1 yaml-syntax: a second YAML document, expected one per file",
        "remove the line, or write what stands below into its own file",
    ),
    "indent-below-value": Wrong(
        {19: "      with:"},
        "19:7 yaml-syntax: indented deeper than 'uses' above, which has its value already",
        "indent it by 4 spaces, as line 18",
    ),
    "indent-first-key": Wrong(
        {2: " name: indent-first-key"},
        "2:2 yaml-syntax: indented deeper than 'dodo' above, which has its value already",
        "begin it in the first column, as line 1",
    ),
    "indent-key-deeper": Wrong(
        {4: "  level: sil"},
        "4:3 yaml-syntax: indented deeper than 'description' above, which has its value already",
        "begin it in the first column, as line 3",
    ),
    "indent-key-shallower": Wrong(
        {13: "   with:"},
        "13:4 yaml-syntax: indented by 3 spaces, but the lines above by 2 or 4",
        "keys of one mapping begin in the same column",
    ),
    "indent-missing-body": Wrong(
        {9: "camera: {uses: virtual-camera, with: {map-path: maps/plain, freq: 10 Hz}}"},
        "9:1 unknown-key: 'camera' stands beside 'environment'; indent it by 2 spaces",
        "it belongs to 'environment'",
    ),
    "indent-one-too-few": Wrong(
        {21: "     walls: [left, right]"},
        "21:6 yaml-syntax: indented by 5 spaces, but the lines above by 4 or 6",
        "keys of one mapping begin in the same column",
    ),
    "indent-one-too-many": Wrong(
        {21: "       walls: [left, right]"},
        "21:8 yaml-syntax: indented deeper than 'goal' above, which has its value already",
        "indent it by 6 spaces, as line 20",
    ),
    "indent-service": Wrong(
        {15: " pose: {uses: integrator, with: {freq: 100 Hz}}"},
        "15:2 yaml-syntax: indented by 1 space, but the lines above by 0 or 2",
        "keys of one mapping begin in the same column",
    ),
    "key-beside-with": Wrong(
        {15: "  pose: {uses: integrator, freq: 100 Hz}"},
        "15:28 unknown-key: unknown key 'freq'",
        "parameters of a service belong into 'with': {freq: ...}",
    ),
    "key-question-mark": Wrong(
        {4: "? level: sil"},
        "4:3 yaml-syntax: this key is a list or a mapping, expected a string",
        "remove the '?' or the brackets",
    ),
    "key-twice": Wrong(
        {20: "      goal: finish\n      goal: line"},
        "21:7 duplicate-key: duplicate key 'goal', first defined in line 20",
        "remove one of the two",
    ),
    "keys-in-one-line": Wrong(
        {4: "level: sil kind: closed-loop", 5: None},
        "4:16 yaml-syntax: a second colon in the value of 'level', which must be one string",
        "write 'kind: closed-loop' into a new line, or the text in quotes",
    ),
    "list-behind-key": Wrong(
        {21: "      walls: - left"},
        "21:14 yaml-syntax: a list with '- ' cannot begin behind its key",
        "write the list in brackets, or each item into its own line",
    ),
    "list-dash-no-blank-first": Wrong(
        {21: "      walls:\n        -left\n        - right"},
        "22:9 yaml-syntax: a space is missing after '-'",
        "write '- left'",
    ),
    "list-dash-no-blank-second": Wrong(
        {21: "      walls:\n        - left\n        -right"},
        "23:9 yaml-syntax: a space is missing after '-'",
        "write '- right'",
    ),
    "list-dash-no-blank": Wrong(
        {21: "      walls:\n        -left\n        -right"},
        "22:9 yaml-syntax: a space is missing after '-'",
        "write '- left'",
    ),
    "list-dash-other": Wrong(
        {21: "      walls:\n        - left\n        – right"},
        "23:9 yaml-syntax: '–' (U+2013) begins no item of a list, expected '-'",
        "write '- right'",
    ),
    "list-for-mapping": Wrong(
        {11: "  - vehicle:"},
        "11:3 yaml-syntax: '- ' begins a list here, but line 15 goes on with a key",
        "remove the '- ' for a mapping of keys",
    ),
    "list-item-too-shallow": Wrong(
        {21: "      walls:\n        - left\n       - right"},
        "23:8 yaml-syntax: this item is indented by 7 spaces, but the one in line 22 by 8",
        "indent it by 8 spaces",
    ),
    "list-layer": Wrong(
        {17: "  - track:", 18: "      uses: collision"},
        "17:3 wrong-type: 'evaluation' is a list, expected a mapping (key: value)",
        "write 'key: value' in place of list items",
    ),
    "list-with": Wrong(
        {20: "      - goal: finish"},
        "20:7 yaml-syntax: '- ' begins a list here, but line 21 goes on with a key",
        "remove the '- ' for a mapping of keys",
    ),
    "mapping-behind-key": Wrong(
        {15: "  pose: uses: integrator"},
        "15:13 yaml-syntax: a second colon in the value of 'pose', which must be one string",
        "write a mapping in braces, 'pose: {uses: integrator}', or into the next lines",
    ),
    "mapping-for-list": Wrong(
        {21: "      walls: {left, right}"},
        "21:14 wrong-type: parameter 'walls' is a mapping, expected a list",
        "write [left, right]",
    ),
    "name-with-a-dash-of-print": Wrong(
        {2: "name: good–test"},
        "2:7 wrong-value: 'good–test' is not allowed here, expected lower-case "
        "letters and digits in words joined by single hyphens, at most 60 characters",
        "write 'name: name-with-a-dash-of-print', as the file is called",
    ),
    "placeholder-braces": Wrong(
        {9: "  camera: {uses: virtual-camera, with: {map-path: maps/plain, freq: {{ matrix.rate }}}}"},
        "9:70 yaml-syntax: '{{ matrix.rate }}' is not a placeholder, and braces mean something else in YAML",
        'write "${matrix.rate}"',
    ),
    "quote-apostrophe": Wrong(
        {3: "description: 'Don't leave the track.'"},
        "3:18 yaml-syntax: this apostrophe ends the text, which is in single quotes",
        "write the text in double quotes",
    ),
    "quote-backslash": Wrong(
        {3: 'description: "C:\\path\\drive"'},
        "3:17 yaml-syntax: '\\p' means nothing within double quotes",
        "write the text in single quotes, where a backslash is a backslash",
    ),
    "quote-double-open": Wrong(
        {3: 'description: "Drive along a straight track to the finish line.'},
        "3:14 yaml-syntax: this quotation mark is not closed in its line",
        'add " at the end of the text',
    ),
    "quote-mixed": Wrong(
        {3: "description: \"Drive along'"},
        "3:14 yaml-syntax: this quotation mark is not closed in its line",
        'add " at the end of the text',
    ),
    "quote-open-flow": Wrong(
        {9: '  camera: {uses: virtual-camera, with: {map-path: maps/plain, freq: "10 Hz}}'},
        "9:69 yaml-syntax: this quotation mark is not closed in its line",
        'add " at the end of the text',
    ),
    "quote-open-single-two": Wrong(
        {12: "    uses: 'dynamic-model", 18: "    uses: 'collision'"},
        "12:11 yaml-syntax: this quotation mark is not closed in its line",
        "add ' at the end of the text",
    ),
    "quote-open-two": Wrong(
        {3: 'description: "Drive along a straight track to the finish line.', 4: 'level: "sil"'},
        "3:14 yaml-syntax: this quotation mark is not closed in its line",
        'add " at the end of the text',
    ),
    "quote-partly": Wrong(
        {3: 'description: "Drive" along the track'},
        "3:22 yaml-syntax: text stands behind the closing quotation mark",
        "put the whole text in quotes",
    ),
    "quote-single-open": Wrong(
        {3: "description: 'Drive along a straight track to the finish line."},
        "3:14 yaml-syntax: this quotation mark is not closed in its line",
        "add ' at the end of the text",
    ),
    "tab-indent": Wrong(
        {18: "\tuses: collision"}, "18:1 yaml-tab: this line is indented with a tab", "indent with spaces"
    ),
    "tab-mixed": Wrong(
        {20: "    \tgoal: finish"}, "20:5 yaml-tab: this line is indented with a tab", "indent with spaces"
    ),
    "text-goes-on": Wrong(
        {3: "description: Drive along a straight track to the finish line\nwithout leaving the track."},
        "4:1 yaml-syntax: a colon is missing after 'without'",
        "write 'without: leaving the track.', or indent the line if it goes on with the text above",
    ),
    "text-not-indented-number": Wrong(
        {6: "timeout:\n60 s"},
        "7:1 yaml-syntax: this text begins in the column of 'timeout' above",
        "indent it: it is the value of 'timeout'",
    ),
    "text-not-indented-value": Wrong(
        {4: "level:\nsil"},
        "5:1 yaml-syntax: this text begins in the column of 'level' above",
        "indent it: it is the value of 'level'",
    ),
    "text-not-indented": Wrong(
        {3: "description: |\nDrive along a straight track."},
        "4:1 yaml-syntax: this text begins in the column of 'description' above",
        "indent it: it is the value of 'description'",
    ),
}
