"""Many sequences encoded by an engine, and the manifest that says what was done."""
