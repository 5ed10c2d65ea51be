"""What the live page shows, as a Bokeh document: a session a browser."""
