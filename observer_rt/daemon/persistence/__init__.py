"""What is kept on disk while the daemon runs, so that a kill, a power cut or a full disk cost little."""
