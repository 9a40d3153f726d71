"""`python -m mufe_fenicsx` is the command `mufe`."""

from .cli import main

if __name__ == "__main__":
    main()
