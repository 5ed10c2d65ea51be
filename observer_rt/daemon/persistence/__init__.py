"""Files on disk while the daemon runs, written so that a kill, a power cut or a full disk cost little."""
