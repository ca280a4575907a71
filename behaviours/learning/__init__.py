"""What is worked out offline, from films and photographs; a running level imports nothing of this."""
