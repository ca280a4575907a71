"""The HTML page of a run: `writer` fills ``page.html``; ``three.bundle.js`` tells how three.js is bundled."""
