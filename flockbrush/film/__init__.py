"""Everything that looks at pictures: clips, stabilising, masks, bodies, tracks, birds."""
