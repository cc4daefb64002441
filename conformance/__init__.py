"""What `.reel` streams mean, a second time: a plain reader, and streams with what they hold."""
