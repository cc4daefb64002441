"""Values: mesh sequences, tracks, surfaces and materials."""
