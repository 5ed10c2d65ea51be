"""Parts of the terminal view: what is said of the service, curves of the last injection, the recent injections."""
