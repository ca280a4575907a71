"""Makers of heavy files find their place here, each with the kind of file that it writes (see `kinds.py`)."""

MOST = 99 * 10**6  # bytes of a file
MAKERS = {}  # {name: (kind, maker)}


def heavy(kind):
    """Register a function that writes a file of this kind (see `kinds.py`)."""

    def registered(function):
        MAKERS[function.__name__] = kind, function
        return function

    return registered


def filled(path, piece, head=b"", tail=b"", size=MOST):
    """Write a file of about this size: a head, one piece again and again, a tail."""
    block = piece * max(1, (1 << 20) // len(piece))
    with open(path, "wb") as file:
        file.write(head)
        for _ in range((size - len(head) - len(tail)) // len(block)):
            file.write(block)
        file.write(tail)
