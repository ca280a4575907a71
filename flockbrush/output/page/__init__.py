"""A run as one page: `writer` fills ``page.html``; ``three.bundle.js`` says how three.js is bundled."""
