"""The process backend: local processes in their own sandbox."""
