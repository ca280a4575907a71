"""What happens in a tick: commands, ground, sense, decide, steer, speed, move, live, record."""
