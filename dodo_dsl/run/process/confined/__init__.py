"""The application's processes, apart from DoDo's own: by bubblewrap and a seccomp filter."""
