"""Other codecs, each behind the same protocol."""
