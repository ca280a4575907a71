"""Birds in line formations (Klotsman & Tal): what a formation saves, its key shapes, its steady flight, its making."""
