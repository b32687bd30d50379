"""Sphinx's settings for the documentation as a site: ``make site`` builds it into build/site, without a network.

Pages are the Markdown files of the repository where they are, so that the same links work in both.
"""

project = "DoDo"
author = "the DoDo developers"
extensions = ["myst_parser"]
root_doc = "docs/index"
include_patterns = [
    "README.md", "CHANGELOG.md", "CONTRIBUTING.md", "benchmarks/README.md", "docs/*.md", "docs/**/*.md", "examples/**/README.md",
    "firmware/README.md", "services/*/README.md",
]
source_suffix = {".md": "markdown"}
exclude_patterns = ["build", ".venv"]
myst_heading_anchors = 4
html_theme = "furo"
html_title = "DoDo"
html_copy_source = False
html_show_sphinx = False
