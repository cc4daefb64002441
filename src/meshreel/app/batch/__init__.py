"""Many sequences, encoded by an engine, and the manifest that records the outcome of each."""
