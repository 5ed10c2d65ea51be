"""The live page: how smoothly it is drawn, in a real browser, beside a page with a single line."""
