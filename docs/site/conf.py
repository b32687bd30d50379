"""Sphinx's settings for the documentation as a site: ``make site`` builds it into build/site, without a network.

Pages are the Markdown files of the repository where they are, so that their links work in both.
"""

project = "DoDo"
author = "the DoDo developers"
extensions = ["myst_parser"]
source_suffix = {".md": "markdown"}
root_doc = "docs/index"
include_patterns = [
    "README.md",
    "CHANGELOG.md",
    "CODE_OF_CONDUCT.md",
    "CONTRIBUTING.md",
    "SECURITY.md",
    "benchmarks/README.md",
    "docs/*.md",
    "docs/**/*.md",
    "examples/**/README.md",
    "firmware/README.md",
    "services/*/README.md",
]
exclude_patterns = ["build", ".venv"]
suppress_warnings = ["misc.highlighting_failure"]  # pages show YAML that is wrong
myst_heading_anchors = 4
html_theme = "furo"
html_title = "DoDo"
html_copy_source = False
html_show_sphinx = False
templates_path = ["."]
html_sidebars = {
    "**": [
        "sidebar/brand.html",
        "sidebar/search.html",
        "sidebar/scroll-start.html",
        "sidebar/navigation.html",
        "demo.html",
        "sidebar/scroll-end.html",
    ]
}
