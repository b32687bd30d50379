"""The commonest slips of YAML: what each changes in the good test, and what is said about it, by place and rule.

The changes are texts for lines of ``good.dodo.yml``, None where a line goes. Names that begin with ``crlf`` have lines
as Windows ends them.
"""

SLIPS: dict[str, tuple[dict[int, str | None], str]] = {
    "alias-misspelt": (
        {
            9: "  camera: {uses: virtual-camera, with: {map-path: maps/plain, freq: &rate 10 Hz}}",
            14: "      freq: *raet",
        },
        "14:13 yaml-syntax",
    ),
    "block-above-brace-too-many": (
        {
            3: "description: >-\n  Drive along a straight track:\n  to the finish line, 'slowly [and",
            15: "  pose: {uses: integrator, with: {freq: 100 Hz}}}",
        },
        "17:49 yaml-syntax",
    ),
    "block-above-colon": (
        {
            3: "description: >\n  Drive along a straight track:\n  to the finish line, 'slowly [and",
            22: "      max-time:40 s",
        },
        "24:15 yaml-syntax",
    ),
    "block-above-indent": ({3: "description: >\n  Drive\n\n   key: value\n level: sil", 4: None}, "7:2 yaml-syntax"),
    "block-above-quote": (
        {
            3: "description: > # why\n  Drive along a straight track:\n  to the finish line, 'slowly [and",
            20: '      goal: "finish',
        },
        "22:13 yaml-syntax",
    ),
    "block-below-conflict": (
        {3: "description: |\n  =======\n  Drive", 21: "      walls:[left, right]"},
        "23:12 yaml-syntax",
    ),
    "bracket-brace-open": (
        {9: "  camera: {uses: virtual-camera, with: {map-path: maps/plain, freq: 10 Hz}"},
        "9:11 yaml-syntax",
    ),
    "bracket-comma-missing": (
        {9: "  camera: {uses: virtual-camera with: {map-path: maps/plain, freq: 10 Hz}}"},
        "9:33 yaml-syntax",
    ),
    "bracket-flow-colon": ({15: "  pose: {uses: integrator, with: {freq 100 Hz}}"}, "15:35 unknown-parameter"),
    "bracket-long-open": (
        {9: "  camera: {uses: virtual-camera,\n           with: {map-path: maps/plain, freq: 10 Hz}"},
        "9:11 yaml-syntax",
    ),
    "bracket-placeholder": (
        {9: "  camera: {uses: virtual-camera, with: {map-path: maps/plain, freq: ${matrix.freq}}}"},
        "9:69 yaml-syntax",
    ),
    "bracket-square-open": ({21: "      walls: [left, right"}, "21:14 yaml-syntax"),
    "bracket-too-many": (
        {9: "  camera: {uses: virtual-camera, with: {map-path: maps/plain, freq: 10 Hz}}}"},
        "9:76 yaml-syntax",
    ),
    "bracket-wrong-kind": ({21: "      walls: [left, right}"}, "21:26 yaml-syntax"),
    "char-at": ({3: "description: @Drive along a straight track to the finish line."}, "3:14 yaml-syntax"),
    "char-backtick": ({4: "level: `sil`"}, "4:8 yaml-syntax"),
    "char-byte-order-mark": ({4: "\ufefflevel: sil"}, "4:1 yaml-syntax"),
    "char-nbsp-in-value": ({6: "timeout: 60\xa0s"}, "6:10 wrong-unit"),
    "char-nbsp-indent": ({18: "\xa0\xa0\xa0 uses: collision"}, "18:3 yaml-syntax"),
    "char-nbsp": ({4: "level:\xa0sil"}, "4:7 yaml-syntax"),
    "char-nul": ({4: "level: s\x00il"}, "4:9 yaml-syntax"),
    "char-percent-share": ({6: "timeout: %60 # of them"}, "6:10 yaml-syntax"),
    "char-zero-width": ({4: "level: s\u200bil"}, "4:8 wrong-value"),
    "colon-equals": ({4: "level = sil"}, "4:1 yaml-syntax"),
    "colon-further-down": (
        {3: "description: Drive along a straight track\n  to the finish line. Note: slowly."},
        "4:3 yaml-syntax",
    ),
    "colon-in-text": ({3: "description: Note: drive along a straight track to the finish line."}, "3:18 yaml-syntax"),
    "colon-missing-section": ({10: "action"}, "10:1 yaml-syntax"),
    "colon-missing": ({4: "level sil"}, "4:1 yaml-syntax"),
    "colon-no-blank-brace": ({13: "    with:{freq: 100 Hz}", 14: None}, "13:5 unknown-key"),
    "colon-no-blank-flow": ({15: "  pose: {uses:integrator, with: {freq: 100 Hz}}"}, "15:10 unknown-key"),
    "colon-no-blank": ({4: "level:sil"}, "4:6 yaml-syntax"),
    "crlf-tab": ({18: "\tuses: collision"}, "18:1 yaml-syntax"),
    "dash-for-key": ({4: "- level: sil"}, "4:1 yaml-syntax"),
    "document-second": ({7: "clock: lockstep\n---"}, "8:1 yaml-syntax"),
    "indent-below-value": ({19: "      with:"}, "19:7 yaml-syntax"),
    "indent-first-key": ({2: " name: indent-first-key"}, "2:2 yaml-syntax"),
    "indent-key-deeper": ({4: "  level: sil"}, "4:3 yaml-syntax"),
    "indent-key-shallower": ({13: "   with:"}, "13:4 yaml-syntax"),
    "indent-one-too-few": ({21: "     walls: [left, right]"}, "21:6 yaml-syntax"),
    "indent-one-too-many": ({21: "       walls: [left, right]"}, "21:8 yaml-syntax"),
    "key-beside-with": ({15: "  pose: {uses: integrator, freq: 100 Hz}"}, "15:28 unknown-key"),
    "key-question-mark": ({4: "? level: sil"}, "4:3 yaml-syntax"),
    "key-twice": ({20: "      goal: finish\n      goal: line"}, "21:7 duplicate-key"),
    "list-behind-key": ({21: "      walls: - left"}, "21:14 yaml-syntax"),
    "list-dash-no-blank-second": ({21: "      walls:\n        - left\n        -right"}, "23:9 yaml-syntax"),
    "list-dash-no-blank": ({21: "      walls:\n        -left\n        -right"}, "22:9 yaml-syntax"),
    "list-for-mapping": ({11: "  - vehicle:"}, "11:3 yaml-syntax"),
    "list-item-too-shallow": ({21: "      walls:\n        - left\n       - right"}, "23:8 yaml-syntax"),
    "list-layer": ({17: "  - track:", 18: "      uses: collision"}, "17:3 wrong-type"),
    "list-with": ({20: "      - goal: finish"}, "20:7 yaml-syntax"),
    "mapping-behind-key": ({15: "  pose: uses: integrator"}, "15:13 yaml-syntax"),
    "mapping-for-list": ({21: "      walls: {left, right}"}, "21:14 wrong-type"),
    "placeholder-braces": (
        {9: "  camera: {uses: virtual-camera, with: {map-path: maps/plain, freq: {{ matrix.rate }}}}"},
        "9:70 yaml-syntax",
    ),
    "quote-apostrophe": ({3: "description: 'Don't leave the track.'"}, "3:19 yaml-syntax"),
    "quote-double-open": ({3: 'description: "Drive along a straight track to the finish line.'}, "3:14 yaml-syntax"),
    "quote-open-flow": (
        {9: '  camera: {uses: virtual-camera, with: {map-path: maps/plain, freq: "10 Hz}}'},
        "9:69 yaml-syntax",
    ),
    "quote-open-single-two": ({12: "    uses: 'dynamic-model", 18: "    uses: 'collision'"}, "12:11 yaml-syntax"),
    "quote-open-two": (
        {3: 'description: "Drive along a straight track to the finish line.', 4: 'level: "sil"'},
        "3:14 yaml-syntax",
    ),
    "quote-partly": ({3: 'description: "Drive" along the track'}, "3:22 yaml-syntax"),
    "quote-single-open": ({3: "description: 'Drive along a straight track to the finish line."}, "3:14 yaml-syntax"),
    "tab-indent": ({18: "\tuses: collision"}, "18:1 yaml-syntax"),
    "tab-mixed": ({20: "    \tgoal: finish"}, "20:5 yaml-syntax"),
    "text-goes-on": (
        {3: "description: Drive along a straight track to the finish line\nwithout leaving the track."},
        "4:1 yaml-syntax",
    ),
    "text-not-indented": ({3: "description: |\nDrive along a straight track."}, "4:1 yaml-syntax"),
}
