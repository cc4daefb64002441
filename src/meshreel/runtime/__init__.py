"""Running work: threads, worker processes, progress, profiling, remote files, atomic output."""
