"""Daemons that learn are killed at random moments: what is on disk afterwards?"""
