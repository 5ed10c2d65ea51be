"""The user's side: commands, checks, evaluated recordings, figures, fleets, the live page."""
