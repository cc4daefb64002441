"""A track of ours beside compressors of arrays, at equal largest error."""
