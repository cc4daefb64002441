"""Numbers to integers and back: here floats stop."""
