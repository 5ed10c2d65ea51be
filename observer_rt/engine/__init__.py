"""One injector's observer on frames: estimation, stream, learning, validity, reports. No socket, file or clock."""
