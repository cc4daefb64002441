"""`python -m meshreel`: the program `meshreel`, where its script is not on the path."""

from meshreel.app.cli import main

if __name__ == "__main__":
    main()
