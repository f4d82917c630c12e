"""The container: MCAP files read whole, walked when damaged, and written so that a crash costs little."""
