"""Frame sequences: read from frame files or arrays, lazily or loaded, and streamed to writers."""
