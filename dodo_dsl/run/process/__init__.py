"""The process backend: local processes in a sandbox of their own."""
