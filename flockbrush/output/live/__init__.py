"""The live link: a running herd over a WebSocket, drawn and steered by other programs."""
