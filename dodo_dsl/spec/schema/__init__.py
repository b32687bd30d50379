"""The JSON Schemas of specs, manifests and dodo.yml, and what is said where a file does not fit."""
