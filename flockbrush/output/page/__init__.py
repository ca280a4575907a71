"""The HTML page of a run: `writer` fills ``page.html``; ``three.bundle.js`` describes how three.js is bundled."""
