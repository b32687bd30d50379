"""What the runner and services of DoDo say to each other."""
