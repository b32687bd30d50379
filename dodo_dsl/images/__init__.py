"""Images of DoDo's services: the build context, the wheels in it, and the docker commands that build and push."""
