"""`python -m rudc`: the command line."""

from rudc.cli.main import main

if __name__ == "__main__":
    main()
