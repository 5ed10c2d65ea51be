"""What a person sits in front of: commands, checks, evaluated recordings, figures, fleets, the live page."""
