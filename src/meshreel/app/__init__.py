"""Programs built on the library: command line, batch encoding, player, notebook display."""
