"""Kit of the command lines of both packages: programs, exit codes, progress, option groups, files of results."""
