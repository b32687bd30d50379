"""The mixed backend: the application in containers, DoDo's services beside it as local processes."""
