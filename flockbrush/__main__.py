"""``python -m flockbrush`` is the command ``flockbrush``."""

from flockbrush.cli.main import main

if __name__ == "__main__":
    main()
