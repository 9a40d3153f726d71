"""`python -m mufe_fenicsx` is the command `mufe`."""

from .cli.main import main

if __name__ == "__main__":
    main()
