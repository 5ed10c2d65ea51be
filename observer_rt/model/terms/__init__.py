"""Terms: corrections of the model, stated as laws in text by users and `discover`."""
