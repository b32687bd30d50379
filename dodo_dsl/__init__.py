"""DoDo: declarative integration tests for robots and vehicles made of microservices."""

__version__ = "0.1.0"
