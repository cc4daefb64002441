"""`python -m meshreel` runs the program `meshreel` if its script is not on the path."""

from meshreel.app.cli import main

if __name__ == "__main__":
    main()
