"""Pictures and animations of problems and solutions, for files; matplotlib without a window."""
