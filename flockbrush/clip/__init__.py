"""What a person marks in a film: landmarks, masks, body colour, birds, sketched paths.  No window is needed for it."""
