"""The docker backend: containers through ``docker compose``."""
