"""An independent reader of `.reel` streams, and test streams with their expected contents."""
