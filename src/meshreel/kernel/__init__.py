"""The core, the C library of `core/`, for arrays: what both sides of a stream must agree on."""
