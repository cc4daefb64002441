"""How work is done: threads, workers, progress, seconds by stage, and outputs that appear whole."""
