"""Running work: threads, worker processes, progress, remote files, atomic output."""
