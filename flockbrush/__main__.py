"""``python -m flockbrush`` is the command ``flockbrush``."""

import sys


def main():
    """Run the command; Ctrl-C while it is being loaded ends it as it does later."""
    try:
        from flockbrush.cli.main import main as run
    except KeyboardInterrupt:
        sys.stderr.write("stopped\n")
        sys.exit(130)
    run()


if __name__ == "__main__":
    main()
